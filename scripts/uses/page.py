"""The tables of docs/PROOF.md from the figures of single scans.

Figures are means over the scans with 95 % intervals of Student's t. Methods are compared scan by scan: by
the logarithm of the ratio of their errors, whose mean has such an interval, and for every other figure by
its difference. "Better" and "worse" are said where the interval contains no ratio of 1, or no difference of 0.
"""

import math
import os
from pathlib import Path

import numpy as np
from scipy.stats import t

from samplers import METHODS, OURS

BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"
TITLES = {
    "meshing": "Meshing",
    "registration": "Registration",
    "change": "Change of 2 cm",
    "terrain": "Terrain and volume",
}
# What is good: less, more, or near a number. Figures without one are shown and not judged.
LESS, MORE = "less", "more"
# Head, name and aim of the columns of each use's table.
COLUMNS = {
    "meshing": [
        ("error, mm", "error", LESS),
        ("mesh to truth, mm", "mesh to truth", LESS),
        ("truth to mesh, mm", "truth to mesh", LESS),
        ("smallest angle, median °", "angle, median", MORE),
        ("smallest angle, 1 % °", "angle, 1 %", MORE),
        ("open edges, %", "open edges", LESS),
        ("holes, %", "holes", LESS),
        ("unused points", "unused", LESS),
    ],
    "registration": [
        ("error, mm", "error", LESS),
        ("of successes, mm", "error of successes", LESS),
        ("failures, %", "failures", LESS),
    ],
    "change": [
        ("error, mm", "error", LESS),
        ("median, mm", "median", LESS),
        ("away from kerbs, mm", "flat", LESS),
        ("bias, mm", "bias", 0),
        ("level of detection, mm", "level", LESS),
        ("level away from kerbs, mm", "flat level", LESS),
        ("error within the level, %", "within", 95),
        ("raised found, %", "detected", MORE),
        ("unchanged called changed, %", "false", LESS),
        ("raised found with 1 mm, %", "detected, registered", MORE),
        ("unchanged called changed with 1 mm, %", "false, registered", LESS),
        ("without a distance, %", "without", LESS),
    ],
    "terrain": [
        ("error of heights, mm", "error", LESS),
        ("on the heap, mm", "heap", LESS),
        ("bias, mm", "bias", 0),
        ("volume, size of the error, %", "volume", LESS),
        ("volume, signed, %", "signed volume", None),
        ("without a height, %", "unknown", LESS),
    ],
}
# Rows that are no comparison: the points themselves, and the mesh of lloydar's own.
ASIDE = ("points", "its own (`--mesh`)")
OTHERS = [method for method in METHODS if method != OURS]


def interval(values):
    """The mean and half the width of its 95 % interval."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return float(values.mean()) if len(values) else math.nan, math.nan
    half = t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return float(values.mean()), float(half)


def compared(groups):
    """The groups of a use in which methods are compared."""
    return [group for group in groups if not group.endswith(ASIDE)]


def verdict(mean, half):
    """What a mean difference of costs, ours less another's, says."""
    if mean + half < 0:
        return "better"
    return "worse" if mean - half > 0 else "no difference shown"


def error_ratio(scans, groups, method):
    """lloydar's error over a method's: mean and interval over scans, of the geometric mean over groups."""
    logs = [
        np.mean([math.log(scan[group][OURS]["error"] / scan[group][method]["error"]) for group in groups])
        for scan in scans
    ]
    mean, half = interval(logs)
    low, middle, high = (math.exp(mean + sign * half) for sign in (-1, 0, 1))
    return f"{middle:.2f} ({low:.2f} – {high:.2f}), {verdict(mean, half)}"


def costs(scans, group, method, name, aim):
    """A figure of each scan as a cost: less is better."""
    values = np.array([scan[group][method][name] for scan in scans], dtype=float)
    if aim == LESS:
        return values
    return -values if aim == MORE else np.abs(values - aim)


def judged(use, scans):
    """Of every figure of a use: group, head, name, and the verdict on lloydar against each other method."""
    for group in compared(scans[0]):
        for title, name, aim in COLUMNS[use]:
            if aim is None or name not in scans[0][group][OURS]:
                continue
            ours = costs(scans, group, OURS, name, aim)
            verdicts = {
                method: verdict(*interval(ours - costs(scans, group, method, name, aim))) for method in OTHERS
            }
            yield group, title, name, verdicts


def number(mean, half):
    if math.isnan(mean):
        return "–"
    size = max(abs(mean), 0 if math.isnan(half) else half)
    digits = 0 if size >= 100 else 1 if size >= 10 else 2
    return f"{mean:.{digits}f}" + ("" if math.isnan(half) else f" ± {half:.{digits}f}")


def figure(scans, group, method, name):
    return number(*interval([scan[group][method][name] for scan in scans]))


def row(cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def head(cells):
    return [row(cells), row(["---"] * len(cells))]


def summary(results):
    """The ratio of errors in each use, and how many figures are better and worse."""
    lines = ["### Errors: lloydar's over the other method's", ""]
    lines += head(["use", *OTHERS])
    for use, scans in results.items():
        groups = compared(scans[0])
        lines.append(row([TITLES[use], *(error_ratio(scans, groups, method) for method in OTHERS)]))
    lines += ["", "### All figures: how many of lloydar's are better, without a difference shown, worse", ""]
    lines += head(["use", "figures", *OTHERS])
    for use, scans in results.items():
        found = [verdicts for *_, verdicts in judged(use, scans)]
        counts = []
        for method in OTHERS:
            said = [verdicts[method] for verdicts in found]
            counts.append(f"{said.count('better')}, {said.count('no difference shown')}, {said.count('worse')}")
        lines.append(row([TITLES[use], len(found), *counts]))
    return lines


def losses(results):
    """Every figure in which another method is better than lloydar beyond the interval."""
    lines = ["### Losses", ""]
    lines += head(["use", "figure", OURS, "better than it"])
    begun = len(lines)
    for use, scans in results.items():
        for group, title, name, verdicts in judged(use, scans):
            winners = [method for method, said in verdicts.items() if said == "worse"]
            if winners:
                shown = "; ".join(f"{method} {figure(scans, group, method, name)}" for method in winners)
                place = f": {group}" if len(compared(scans[0])) > 1 else ""
                lines.append(row([TITLES[use] + place, title, figure(scans, group, OURS, name), shown]))
    return lines if len(lines) > begun else lines[:2] + ["None beyond the intervals."]


def table(use, scans):
    """Errors by group, where there are several, and every figure."""
    lines = [f"### {TITLES[use]}", ""]
    groups = compared(scans[0])
    has_groups = len(groups) > 1
    if has_groups:
        lines += head(["lloydar's error over that of", *OTHERS])
        for group in groups:
            lines.append(row([group, *(error_ratio(scans, [group], method) for method in OTHERS)]))
        lines.append("")
    lines += head([*(["mesh"] if has_groups else []), "points by", *(title for title, *_ in COLUMNS[use])])
    for group in scans[0]:
        for method in scans[0][group]:
            cells = [group, method] if has_groups else [method]
            known = scans[0][group][method]
            cells += [figure(scans, group, method, name) if name in known else "" for _, name, _ in COLUMNS[use]]
            lines.append(row(cells))
    return lines


def facts(options, versions, counts):
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    scans = ", ".join(f"{TITLES[use].lower()} {count}" for use, count in counts.items())
    return [
        f"{options.date}; {os.cpu_count()} virtual cores, {memory:.0f} GiB of memory, Linux; {options.version}, "
        f"commit {options.commit}; `{options.command}`. Simulated scans: {scans}. {versions}."
    ]


def write(path, results, options, versions):
    """Puts the tables between the marks of the page; what people wrote around them stays."""
    parts = [facts(options, versions, {use: len(scans) for use, scans in results.items()})]
    parts += [summary(results), losses(results), *(table(use, scans) for use, scans in results.items())]
    text = Path(path).read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    body = "\n\n".join("\n".join(part) for part in parts)
    Path(path).write_text(f"{before}{BEGIN}\n{body}\n{END}{after}")
