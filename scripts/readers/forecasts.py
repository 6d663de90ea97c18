"""Reads the JSON lines of a run while it works, and prints the errors of its forecasts.

    lloydar run … --log json 2>&1 >/dev/null | forecasts.py LABEL
"""

import json
import sys
import time

said = []
begun = time.monotonic()
for line in sys.stdin:
    event = json.loads(line)
    if event.get("remaining") is not None:
        said.append((time.monotonic() - begun, event["remaining"]))
end = time.monotonic() - begun
later = [(at, rest) for at, rest in said if 0.5 * end <= at <= 0.95 * end]
off = [abs(rest - (end - at)) / (end - at) for at, rest in later]
of_run = [abs(rest - (end - at)) / end for at, rest in later]
places = ", ".join(
    f"{100 * at / end:.0f} %: {rest:.1f} for {end - at:.1f}" for at, rest in later[:: max(1, len(later) // 6)]
)
print(
    f"{sys.argv[1]}: {end:.1f} s; {len(later)} forecasts from half-way to 95 %: "
    f"off by {100 * max(off, default=0):.0f} % of what remained at most, {100 * max(of_run, default=0):.0f} % of the run ({places})"
)
