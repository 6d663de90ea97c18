"""Compares jobs on remote inputs with those on local ones.

    measure.py PROGRAM WORK     WORK/scans: the inputs

Prints, for each input: requests, bytes over those that are needed, seconds over the longer of the transfer and
the local job. The bytes that are needed are those of the file, or, in a quarter of an octree, of the nodes there.
"""

import filecmp
import json
import os
import statistics
import struct
import subprocess
import sys
import time
from pathlib import Path

import boto3

HERE = Path(__file__).parent
RATE, LATENCY, REPEATS = 100.0, 50.0, 3
MEMORY = 256 << 20
MOST_BYTES, MOST_TIME, PIECE = 1.1, 1.3, 16 << 10
# Seconds of a local job from which on the three answers that each job waits for are few.
SHORTEST = 1.0
SECRET = "h1dden-word"


class Served:
    """A directory on a server of our own."""

    def __init__(self, directory, *options):
        command = [sys.executable, str(HERE / "server.py"), str(directory), *map(str, options)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.address = f"http://127.0.0.1:{self.process.stdout.readline().strip()}"

    def sent(self):
        """Requests and bytes since the last call."""
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return [int(number) for number in self.process.stdout.readline().split()]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


def begin(program, work, scan, output, options, environment=None):
    """A job at work. Job directories of outputs in a store lie in `work`."""
    return subprocess.Popen(
        [program, "run", str(scan), "-o", str(output), "--overwrite", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=work,
        env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000", **(environment or {})},
    )


def run(*job):
    """Seconds of a job, and what it prints."""
    began = time.monotonic()
    process = begin(*job)
    said, _ = process.communicate()
    if process.returncode:
        sys.exit(f"{process.args}: {said}")
    return time.monotonic() - began, said


def killed(seconds, *job):
    """Kills a job that takes so many seconds three times, and lets it end; its peak memory, in bytes."""
    peak = 0
    for share in (0.2, 0.5, 0.8, None):
        process = begin(*job)
        if share:
            time.sleep(share * seconds)
            process.kill()
        said = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        peak = max(peak, used.ru_maxrss << 10)
    if process.returncode:
        sys.exit(f"{process.args}, killed before: {said}")
    return peak


def nodes(path, sides):
    """The bytes of the nodes of an octree that reach into `sides`, and of all that is no node."""
    data = Path(path).read_bytes()
    info = data[375 + 54 :]
    x, y, z, half = struct.unpack("<4d", info[:32])
    offset, length = struct.unpack("<2Q", info[40:56])
    within = everything = 0
    for at in range(offset, offset + length, 32):
        level, i, j, _, _, size, count = struct.unpack("<4iQ2i", data[at : at + 32])
        if count <= 0:
            continue
        edge = 2 * half / 2**level
        west, south = x - half + i * edge, y - half + j * edge
        everything += size
        if west <= sides[2] and west + edge >= sides[0] and south <= sides[3] and south + edge >= sides[1]:
            within += size
    return within, len(data) - everything


def quarter(program, scan):
    """The north-eastern quarter of a scan."""
    header = json.loads(subprocess.check_output([program, "info", "--json", str(scan)]))
    (west, south, _), (east, north, _) = header["min"], header["max"]
    # Rounded as they are given to the program: a node that they touch is needed.
    return [round(side, 3) for side in (0.5 * (west + east), 0.5 * (south + north), east, north)]


def jobs(program, scans):
    """Each input with the options of its jobs and the bytes that it needs: of points, and of everything else."""
    for scan in scans:
        count = ["--spacing", "0.5", "--iterations", "5", "--memory", f"{MEMORY >> 20}MiB"]
        yield scan, scan.name, count, scan.stat().st_size, 0
        if scan.name.endswith(".copc.laz"):
            sides = quarter(program, scan)
            within, beside = nodes(scan, sides)
            bounds = ["--bounds", ",".join(f"{side:.3f}" for side in sides)]
            yield scan, f"{scan.name}, a quarter", bounds + count, within, beside


def main(program, work):
    work = Path(work)
    scans = sorted((work / "scans").iterdir())
    local, remote = work / "local.laz", work / "remote.laz"
    good = True

    def same(name):
        nonlocal good
        if not filecmp.cmp(local, remote, shallow=False):
            print(f"{name}: the bytes differ")
            good = False

    print(f"| input | needed, MB | sent / needed | requests | with errors | killed, peak MiB | local, s | transfer, s | {LATENCY:.0f} ms, {RATE:.0f} MB/s, s | ratio |")
    print("| --- " * 10 + "|")
    with (
        Served(work / "scans", "--faults", 0.2) as faulty,
        Served(work / "scans", "--latency", LATENCY, "--rate", RATE) as slow,
    ):
        for scan, name, options, points, beside in jobs(program, scans):
            here = [run(program, work, scan, local, options)[0] for _ in range(REPEATS)]
            run(program, work, f"{faulty.address}/{scan.name}", remote, options)
            same(f"{name}, with errors")
            failed = faulty.sent()[0]
            there = []
            for _ in range(REPEATS):
                there.append(run(program, work, f"{slow.address}/{scan.name}", remote, options)[0])
                same(name)
                requests, sent = slow.sent()
            remote.unlink()
            job = (program, work, f"{slow.address}/{scan.name}", remote, options)
            peak = killed(statistics.median(there), *job)
            same(f"{name}, killed")
            slow.sent()
            transfer = sent / RATE / 1e6
            ratio = statistics.median(there) / max(transfer, statistics.median(here))
            beyond = (sent - beside - 3 * PIECE) / points
            print(
                f"| {name} | {points / 1e6:.2f} | {sent / (points + beside):.3f} | {requests} | {failed} | {peak / 2**20:.0f} "
                f"| {statistics.median(here):.2f} | {transfer:.2f} | {statistics.median(there):.2f} | {ratio:.2f} |",
                flush=True,
            )
            good &= beyond <= MOST_BYTES and peak <= MEMORY
            good &= ratio <= MOST_TIME or statistics.median(here) < SHORTEST
    good &= store(program, work, scans)
    if not good:
        sys.exit("a bar is not met")


def store(program, work, scans):
    """Jobs from a bucket to a bucket, in moto's server; whether all went well."""
    command = [Path(sys.executable).parent / "moto_server", "-p", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        line = next(line for line in server.stdout if "http://" in line)
        endpoint = line.split("Running on ")[1].strip()
        return with_store(program, work, scans, endpoint)
    finally:
        server.kill()


def with_store(program, work, scans, endpoint):
    environment = {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": SECRET,
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    client = boto3.client(
        "s3", endpoint_url=endpoint, aws_access_key_id="key", aws_secret_access_key=SECRET, region_name="us-east-1"
    )
    client.create_bucket(Bucket="city")
    good = True
    for scan in scans:
        client.upload_file(str(scan), "city", f"in/{scan.name}")
        # Large enough for several parts.
        options = ["--ratio", "60%", "--iterations", "0"]
        local, remote = work / f"{scan.name}.las", f"s3://city/out/{scan.name}.las"
        run(program, work, scan, local, options)
        _, said = run(program, work, f"s3://city/in/{scan.name}", remote, options, environment)
        fetched = work / "fetched.las"
        client.download_file("city", f"out/{scan.name}.las", str(fetched))
        names = [item["Key"] for item in client.list_objects_v2(Bucket="city", Prefix=f"out/{scan.name}.las")["Contents"]]
        tag = client.head_object(Bucket="city", Key=f"out/{scan.name}.las")["ETag"]
        pending = client.list_multipart_uploads(Bucket="city").get("Uploads", [])
        is_same = filecmp.cmp(local, fetched, shallow=False)
        is_secret = SECRET not in said
        print(
            f"s3, {scan.name}: bytes {'the same' if is_same else 'DIFFER'}, {fetched.stat().st_size} bytes, tag {tag} "
            f"(parts after -), objects {len(names)}, uploads left {len(pending)}, secret {'not shown' if is_secret else 'SHOWN'}"
        )
        good &= is_same and is_secret and not pending and len(names) >= 3
    done = subprocess.run(
        [program, "info", "s3://city/nothing.laz"], capture_output=True, text=True, env={**os.environ, **environment}
    )
    print(f"s3, no object: {done.stderr.strip()}")
    good &= done.returncode == 1 and "no such object" in done.stderr
    return good


if __name__ == "__main__":
    main(*sys.argv[1:])
