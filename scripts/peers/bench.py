"""Times whole jobs against decoding once and against other programs; scripts/bench-job runs it."""

import importlib.util
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

COUNT, SMALL_COUNT = 100_000, 10_000
# At this distance (in m) CloudCompare leaves of the street about as many points, and with this
# spacing lloydar makes as many: neither has to search for them.
CLOUDCOMPARE_SPACING, SPACING = 0.1905, 0.2287


def read(folder):
    """The points of all LAZ files of a folder, decoded on all cores."""
    import laspy
    import numpy

    backend = laspy.LazBackend.LazrsParallel
    scans = [laspy.read(path, laz_backend=backend) for path in sorted(folder.glob("*.laz"))]
    return numpy.vstack([scan.xyz for scan in scans])


def write(points, path):
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, points.min(axis=0).round()
    scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = points.T
    scan.write(path)


def decode(folder, _output, _count):
    read(folder)


def pymeshlab(folder, output, count):
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=read(folder)))
    meshes.generate_simplified_point_cloud(samplenum=count)
    write(meshes.current_mesh().vertex_matrix(), output)


def point_cloud_utils(folder, output, count):
    import point_cloud_utils

    points = read(folder)
    kept = point_cloud_utils.downsample_point_cloud_poisson_disk(
        points, 0.0, target_num_samples=count, random_seed=1
    )
    write(points[kept], output)


def cloudcompare(folder, output, _count):
    """Debian's build reads no LAS: it gets what laspy decoded."""
    points = read(folder)
    raw = output + ".ply"
    with open(raw, "wb") as ply:
        coordinates = "".join(f"property double {axis}\n" for axis in "xyz")
        head = "ply\nformat binary_little_endian 1.0\n"
        ply.write(f"{head}element vertex {len(points)}\n{coordinates}end_header\n".encode())
        points.astype("<f8").tofile(ply)
    options = "-SILENT -AUTO_SAVE OFF -C_EXPORT_FMT PLY -PLY_EXPORT_FMT BINARY_LE"
    result = output + ".thinned.ply"
    thinned = ["-SS", "SPATIAL", str(CLOUDCOMPARE_SPACING), "-SAVE_CLOUDS", "FILE", result]
    subprocess.run(
        ["CloudCompare", *options.split(), "-O", "-GLOBAL_SHIFT", "AUTO", raw, *thinned],
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )


PEERS = {
    "laspy": decode,
    "pymeshlab": pymeshlab,
    "point_cloud_utils": point_cloud_utils,
    "cloudcompare": cloudcompare,
}


def is_here(peer):
    if peer == "cloudcompare":
        return shutil.which("CloudCompare") is not None
    return importlib.util.find_spec(peer) is not None


def measured(command):
    """Seconds and peak memory (MiB) of a process that must succeed."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.monotonic() - start
    if status != 0:
        sys.exit(f"{command}: failed: {process.stderr.read().decode()[-500:]}")
    return seconds, usage.ru_maxrss / 1024


def simulated(program, work, points, *more):
    folder = work / f"street-{points}"
    if not folder.exists():
        subprocess.run(
            [program, "simulate", "--points", str(points), *more, "-o", str(folder)],
            check=True,
            stdout=subprocess.DEVNULL,
        )
    return folder


def lloydar(program, folder, work, *asked):
    output = str(work / "lloydar.laz")
    return [program, "run", str(folder), "-o", output, *map(str, asked), "--overwrite"]


def compare(title, commands, rounds):
    """Prints medians of the commands in turn, and their ratios to the first."""
    results = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            results[name].append(measured(command))
    print(f"\n{title}; {rounds} rounds, medians\n")
    print("| what | seconds | least to most | times lloydar's | peak MiB |")
    print("| --- | --- | --- | --- | --- |")
    ours = statistics.median(seconds for seconds, _ in results["lloydar"])
    for name, runs in results.items():
        seconds = sorted(seconds for seconds, _ in runs)
        median = statistics.median(seconds)
        peak = max(peak for _, peak in runs)
        span = f"{seconds[0]:.2f} - {seconds[-1]:.2f}"
        print(f"| {name} | {median:.2f} | {span} | {median / ours:.2f} | {peak:.0f} |", flush=True)


def main():
    if sys.argv[1] == "peer":
        name, folder, output, count = sys.argv[2:]
        PEERS[name](Path(folder), output, int(count))
        return
    program, work, rounds = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    street = simulated(program, work, 5_000_000)
    commands = {
        "lloydar": lloydar(program, street, work, "--count", COUNT),
        "lloydar by spacing": lloydar(program, street, work, "--spacing", SPACING),
    }
    for name in PEERS:
        if is_here(name):
            output = str(work / f"{name}.laz")
            peer = [sys.executable, __file__, "peer", name, str(street), output, str(COUNT)]
            commands[f"{name}: decoding once" if name == "laspy" else name] = peer
    compare("Street, 5 M points in 2 files, to 100 K, file to file", commands, rounds)

    wlop = work / "wlop"
    if wlop.exists():
        for points, count in [(500_000, SMALL_COUNT), (5_000_000, COUNT)]:
            scanned = simulated(program, work, points)
            raw = work / "street.xyz"
            read(scanned).astype("float64").tofile(raw)
            commands = {
                "lloydar": lloydar(program, scanned, work, "--count", count),
                "CGAL WLOP": [str(wlop), str(raw), str(work / "wlop.xyz"), str(count)],
            }
            compare(f"Street, {points} points, to {count}", commands, max(1, rounds // 3))


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main()
