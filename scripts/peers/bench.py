"""Times one job, a street to 100 K points, against decoding it once and against other programs;
scripts/bench-job --peers runs it.

    bench.py PROGRAM WORK ROUNDS
"""

import importlib.util
import statistics
import sys
from pathlib import Path

import cloudcompare
from process import measured
from street import simulated

COUNT, SMALL_COUNT = 100_000, 10_000
# At this distance (in m) CloudCompare leaves of the street about as many points, and with this
# spacing lloydar makes as many: neither has to search for them.
CLOUDCOMPARE_SPACING, SPACING = 0.1905, 0.2287


def read(folder):
    from decoding import read

    return read(sorted(folder.glob("*.laz")))


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


def thin_with_cloudcompare(folder, output, _count):
    raw = output + ".ply"
    cloudcompare.write_ply(read(folder), raw)
    cloudcompare.subsample(raw, CLOUDCOMPARE_SPACING, output + ".thinned.ply")


PEERS = {
    "laspy": decode,
    "pymeshlab": pymeshlab,
    "point_cloud_utils": point_cloud_utils,
    "cloudcompare": thin_with_cloudcompare,
}


def is_here(peer):
    if peer == "cloudcompare":
        return cloudcompare.is_here()
    return importlib.util.find_spec(peer) is not None


def lloydar(program, folder, work, *asked):
    output = str(work / "lloydar.laz")
    return [program, "run", str(folder), "-o", output, *map(str, asked), "--overwrite"]


def compare(title, commands, rounds):
    """Prints medians of the commands in turn, and their ratios to the first."""
    results = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            done = measured(command)
            results[name].append((done.seconds, done.peak))
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
    street = simulated(program, work, "5M")
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
        for points, count in [("500K", SMALL_COUNT), ("5M", COUNT)]:
            scanned = simulated(program, work, points)
            raw = work / "street.xyz"
            decoding = Path(__file__).with_name("decoding.py")
            measured([sys.executable, decoding, "xyz", raw, *sorted(scanned.glob("*.laz"))])
            commands = {
                "lloydar": lloydar(program, scanned, work, "--count", count),
                "CGAL WLOP": [str(wlop), str(raw), str(work / "wlop.xyz"), str(count)],
            }
            compare(f"Street, {points} points, to {count}", commands, max(1, rounds // 3))


if __name__ == "__main__":
    main()
