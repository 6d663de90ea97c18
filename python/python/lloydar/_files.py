"""Files of any size: the commands of the program as functions.

Keywords become the words of the command line, which the program itself reads: every option means the same in
both, and the same job gives the same bytes.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Union

import numpy as np

from . import _lloydar
from ._allocator import return_freed_memory
from ._errors import OptionError
from ._memory import Acceleration, Patch, SeedRule
from ._points import read
from ._records import Measured, Plan, Report
from ._tasks import ProgressOption, follow, wait_for_abandoned

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["JobOptions", "info", "measure", "plan", "render", "run", "simulate"]

PathLike = Union[str, "os.PathLike[str]"]
#: A file, a directory, a pattern such as ``scans/*.laz``, or several of them.
Inputs = Union[PathLike, Iterable[PathLike]]
#: A length in units of the CRS, or a text with a unit: ``"5cm"``, ``"0.2ft"``.
Length = Union[float, str]
#: A number of points or bytes, or a text: ``"2M"``, ``"4GiB"``.
Amount = Union[int, str]


class JobOptions(TypedDict, total=False):
    """Options of `run` and `plan`: those of the command line, with underscores in their names."""

    spacing: Length | None
    count: Amount | None
    ratio: float | str | None
    density: PathLike | None
    spacing_of: str | Iterable[str] | None
    gradation: float | None
    exact: bool
    memory: Amount | None
    threads: int | None
    job: PathLike | None
    keep_job: bool
    iterations: int | None
    accelerate: Acceleration | None
    seeds: SeedRule | None
    patch: Patch | None
    restrict: Length | None
    smooth: Length | None
    fill: Length | None
    edges: Literal["smooth", "sharp", "on"] | None
    isolated: Literal["keep", "drop", "mark"] | None
    seed: int | None
    tile_size: Length | None
    halo: Length | None
    keep_class: int | Iterable[int] | None
    drop_class: int | Iterable[int] | None
    drop_withheld: bool
    bounds: Sequence[float] | str | None
    polygon: PathLike | None
    crs: str | PathLike | None
    reproject: str | None
    levels: Literal["all", "auto"] | None
    transients: Literal["keep", "drop"] | None
    on_bad_file: Literal["stop", "skip"] | None
    color: Literal["nearest", "mean"] | None
    #: "class" is a word of Python: the option --class has this name.
    class_: Literal["nearest", "majority"] | None
    #: "with" is a word of Python: the option --with has this name.
    with_: str | Iterable[str] | None
    output_tiles: Length | None
    format: Literal["laz", "pcd"] | None
    order: Literal["nearby", "progressive"] | None
    pcd: Literal["binary", "compressed"] | None
    pcd_origin: Sequence[float] | str | None
    mesh: PathLike | None
    mesh_of: Literal["surfaces", "all"] | None
    scanner: Sequence[float] | Sequence[Sequence[float]] | str | None
    trajectory: PathLike | None
    overwrite: bool
    config: PathLike | None


def run(
    inputs: Inputs,
    output: PathLike,
    *,
    restart: bool = False,
    progress: ProgressOption = False,
    **options: Unpack[JobOptions],
) -> Report:
    """Resamples scans of any size into one even cloud, within a memory budget.

    Writes the cloud, and beside it its report (``.report.html``, ``.report.json``) and viewer
    (``.viewer.html``): the same bytes as the command line. A call that was interrupted is continued by the
    same call.

    Parameters
    ----------
    inputs : path or list of paths
        LAS, LAZ, COPC and PLY files, directories, patterns such as ``scans/*.laz``.
    output : path
        The ending decides the format: ``.copc.laz``, ``.laz``, ``.las``, ``.ply`` or ``.pcd``; with `output_tiles` it is a
        directory.
    restart : bool, default False
        Discard what an earlier run left in the job directory.
    progress : bool or callable, default False
        ``True`` shows bars of tqdm if it is installed; a callable is called with a `Progress`.
    spacing : float or str
        Distance between neighbouring output points: in units of the CRS, or with a unit, ``"5cm"``. Without
        `spacing`, `count` and `ratio` a round spacing is proposed from the scan; the report has it.
    count : int or str
        Number of output points: ``2_000_000``, ``"2M"``.
    ratio : float or str
        Output points for each input point: ``0.02``, ``"2%"``.
    density : path, optional
        TOML file with rules for the spacing, by class, attribute, area, distance from a line, height above ground or
        curvature; `spacing` holds where no rule applies.
    spacing_of : str or list of str, optional
        Such rules in short: ``"class=2:0.5,6:0.1"``.
    gradation : float, optional
        How many times as long a cell may be as its neighbour where the spacing follows rules; 1.15 by default.
    exact : bool, default False
        Meet `count` or `ratio` exactly, and not only within 0.3 %.
    memory : int or str, optional
        Peak memory of the process in bytes, or ``"4GiB"``; three quarters of what the cgroup or the machine
        allows by default. If it is given, the C library of Linux is asked to return freed memory to the system
        from then on.
    threads : int, optional
        Worker threads; one per core by default.
    job : path, optional
        Directory for temporary files; ``OUTPUT.job`` by default.
    keep_job, overwrite : bool, default False
        Keep that directory after success; replace an existing output.
    iterations, accelerate, seeds, patch, smooth, fill, restrict, seed : optional
        How the cloud is solved, as for `resample`; lengths may have units.
    edges : {"smooth", "sharp", "on"}, optional
        Where points at sharp edges end: on fitted surfaces, on the planes that meet there, or on the edge.
    isolated : {"keep", "drop", "mark"}, optional
        What becomes of isolated returns, such as rain, birds and echoes; mark gives them class 7.
    tile_size, halo : float or str, optional
        Edge of the tiles; width of what they see around them.
    keep_class, drop_class : int or list of int, optional
        Classes to keep, or to leave out.
    drop_withheld : bool, default False
        Leave out points with the flag "withheld".
    bounds : (xmin, ymin, xmax, ymax), optional
        Keep only the points in the rectangle.
    polygon : path, optional
        Keep only the points in the polygons of a file: well-known text or GeoJSON.
    crs : str, optional
        The CRS of all inputs, in place of what their headers state: ``"EPSG:32633"``.
    reproject : str, optional
        The CRS to which inputs are reprojected as they are read: ``"EPSG:32633"``, or ``"auto"`` for the UTM zone of
        their middle. Lengths, `bounds` and `polygon` are in it.
    levels : {"all", "auto"}, optional
        Levels of octrees (COPC) that are read; auto: the upper ones that are dense enough for the spacing.
    transients : {"keep", "drop"}, optional
        What becomes of cars and people that one pass saw and others looked through; drop needs `trajectory`.
    on_bad_file : {"stop", "skip"}, optional
        What to do with inputs that cannot be read.
    color : {"nearest", "mean"}, optional
        Source of colours and intensity: the nearest input point, or the mean of those in the cell.
    class_ : {"nearest", "majority"}, optional
        Source of the class.
    with_ : str or list of str, optional
        Extra attributes: ``"normals"``, ``"curvature"``, ``"area"``, ``"density"``, ``"distance"``, ``"spacing"``.
    output_tiles : float or str, optional
        Write a directory of square tiles with this edge.
    format : {"laz", "pcd"}, optional
        Format of the tiles; pcd: with the index of Autoware.
    order : {"nearby", "progressive"}, optional
        Order of the points in LAZ, LAS and PLY files; progressive: the first points, however many, are a coarser cloud.
    pcd : {"binary", "compressed"}, optional
        Encoding of PCD files.
    pcd_origin : (x, y, z) or "mgrs", optional
        Place with the coordinates 0, 0, 0 in PCD files, whose coordinates have 24 bits.
    mesh : path, optional
        Write a mesh of the points, too: ``.ply``, ``.obj`` or ``.glb``; with `output_tiles` also a directory.
    mesh_of : {"surfaces", "all"}, optional
        Points that have triangles; all: on wires and leaves, too.
    scanner : (x, y, z) or list of (x, y, z), optional
        Places where scanners stood, towards which the mesh looks.
    trajectory : path, optional
        Way of a moving scanner, towards which the mesh looks, and by which transients are found: a CSV file with the
        columns time, x, y, z.
    config : path, optional
        TOML file with options; keywords win.

    Returns
    -------
    Report
        All figures of the report.

    Raises
    ------
    InputError
        If inputs cannot be read or merged; `files` names them.
    OutputError
        If the output exists already, or cannot be written.
    OptionError
        If an option is out of its range.
    RequestError
        If the scan does not carry what is requested.
    ResourceError
        If memory or disk are too little; the message says what is needed.
    KeyboardInterrupt
        At Ctrl-C, within a second; the same call continues the job.
    """
    words = _job_words(options, output)
    if restart:
        words.append("--restart")
    if options.get("memory") is not None:
        return_freed_memory()
    wait_for_abandoned()
    text = _call("run", words, _paths(inputs), progress, os.fspath(output), options.get("threads"))
    return Report(json.loads(text))


def plan(
    inputs: Inputs,
    output: PathLike = "resampled.copc.laz",
    *,
    progress: ProgressOption = False,
    **options: Unpack[JobOptions],
) -> Plan | None:
    """Says what a run would take: tiles, memory, disk, time. Leaves no files behind.

    Parameters
    ----------
    inputs, output, progress, **options
        As for `run`.

    Returns
    -------
    Plan or None
        `None` if the output is complete already.

    Raises
    ------
    InputError, OptionError, RequestError, ResourceError
        As for `run`.
    """
    words = _job_words(options, output)
    wait_for_abandoned()
    text = _call("plan", words, _paths(inputs), progress, os.fspath(output), options.get("threads"))
    figures = json.loads(text)
    return None if figures is None else Plan(figures)


def measure(
    cloud: Any, *, against: Any = None, truth: PathLike | None = None, memory: Amount | None = None
) -> Measured:
    """Measures how even a cloud is, and how near to the scan it was made from, whatever made it.

    Parameters
    ----------
    cloud : path, list of paths, or points as for `resample`
        The cloud. Points in memory are written to a temporary file first.
    against : path, list of paths, or points, optional
        What the cloud was made from: adds the distances in both directions.
    truth : path, optional
        The directory of the simulated street that the cloud was made from: adds the distances to its surfaces.
    memory : int or str, optional
        Peak memory, as for `run`.

    Returns
    -------
    Measured
        Figures of uniformity and distances.

    Raises
    ------
    InputError, RequestError, ResourceError
        If a cloud cannot be read, has no two different points, or does not fit the memory.
    """
    with tempfile.TemporaryDirectory(prefix="lloydar-") as folder:
        words = _words({"truth": truth, "memory": memory})
        if against is not None:
            paths = _paths_or_points(against, Path(folder, "against.ply"))
            words += [f"--against={path}" for path in paths]
        paths = _paths_or_points(cloud, Path(folder, "cloud.ply"))
        return Measured(json.loads(_call("measure", words, paths)))


def info(inputs: Inputs) -> list[dict[str, Any]]:
    """Reads the headers of scans.

    Parameters
    ----------
    inputs : path or list of paths
        Files, directories, patterns.

    Returns
    -------
    list of dict
        For each file: ``file``, ``kind``, ``points``, ``min``, ``max``, ``scale``, ``crs``, ``extra_bytes``,
        ``notes`` on what is unusual, and others.

    Raises
    ------
    InputError
        At the first file that cannot be read.
    """
    headers: list[dict[str, Any]] = json.loads(_call("info", [], _paths(inputs)))
    return headers


def simulate(
    output: PathLike = "street",
    *,
    length: float = 120.0,
    points: Amount = 2_000_000,
    passes: int = 2,
    noise: float = 0.01,
    strays: float = 0.0,
    passing: int = 0,
    seed: int = 1,
    overwrite: bool = False,
) -> list[Path]:
    """Writes a simulated mobile-mapping street, one LAZ file a pass.

    Parameters
    ----------
    output : path, default "street"
        Directory for the files.
    length : float, default 120
        Length of the street in metres.
    points : int or str, default 2_000_000
        Number of points of all passes together, approximately.
    passes : int, default 2
        Number of times that the vehicle drives down the street.
    noise : float, default 0.01
        Standard deviation of the ranges in metres.
    strays : float, default 0
        Share of the points that are strays, of class 7: rain, echoes, beams that meet two surfaces.
    passing : int, default 0
        Cars and people of which each is there in one pass only, of class 64.
    seed : int, default 1
        Seed of the street and of the noise.
    overwrite : bool, default False
        Whether an existing street is replaced.

    Returns
    -------
    list of pathlib.Path
        The scans.

    Raises
    ------
    OptionError
        If no such street can be simulated.
    OutputError
        If a file of the street exists already.
    """
    options = {"length": length, "points": points, "passes": passes, "noise": noise}
    options |= {"strays": strays, "passing": passing, "seed": seed, "overwrite": overwrite}
    words = [*_words(options), f"--output={os.fspath(output)}"]
    scans = json.loads(_call("simulate", words, [], output=os.fspath(output)))
    return [Path(path) for path, _ in scans]


def render(
    clouds: Inputs,
    output: PathLike = "cloud.png",
    *,
    view: Literal["top", "oblique", "street"] = "oblique",
    by: Literal["auto", "height", "intensity", "class"] = "auto",
    size: tuple[int, int] = (1600, 900),
    point_size: float | None = None,
) -> Path:
    """Draws clouds of any size: a picture in PNG.

    Parameters
    ----------
    clouds : path or list of paths
        The clouds.
    output : path, default "cloud.png"
        The picture.
    view : {"oblique", "top", "street"}
        From where the cloud is seen.
    by : {"auto", "height", "intensity", "class"}
        What decides the colours; ``"auto"`` takes those of the points if they have some.
    size : (int, int), default (1600, 900)
        Width and height in pixels.
    point_size : float, optional
        Diameter of the points, in units of the CRS.

    Returns
    -------
    pathlib.Path
        The picture.
    """
    width, height = size
    options = {"view": view, "by": by, "size": f"{width}x{height}", "point_size": point_size}
    words = [*_words(options), f"--output={os.fspath(output)}"]
    _call("render", words, _paths(clouds), output=os.fspath(output))
    return Path(output)


def _call(
    command: str,
    words: list[str],
    inputs: list[str],
    progress: ProgressOption = False,
    output: str | None = None,
    threads: Any = None,
) -> str:
    """Carries out a command of the program, and returns its result."""
    # What comes after "--" is no option, whatever its first letter.
    all_words = ["lloydar", command, *words, *(["--", *inputs] if inputs else [])]
    threads = threads if isinstance(threads, int) and 0 < threads <= 1024 else None
    text: str = follow(_lloydar.call(all_words, output=output, threads=threads), progress)
    return text


def _job_words(options: JobOptions, output: PathLike) -> list[str]:
    unknown = options.keys() - JobOptions.__annotations__.keys()
    if unknown:
        raise TypeError(f"unknown options: {', '.join(sorted(unknown))}")
    return [*_words(dict(options)), f"--output={os.fspath(output)}"]


def _words(options: dict[str, Any]) -> list[str]:
    """Writes keywords as words of the command line."""
    words = []
    for name, value in options.items():
        flag = f"--{name.rstrip('_').replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif value is not None and value is not False:
            words.append(f"{flag}={_text(name, value)}")
    return words


def _text(option: str, value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, (bool, int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        # All digits that tell the number from others, and no exponent.
        return np.format_float_positional(float(value), trim="-")
    if isinstance(value, Iterable) and not isinstance(value, (bytes, Mapping)):
        items = list(value)
        # Places of several scanners are lists in a list.
        nested = bool(items) and not isinstance(items[0], str) and isinstance(items[0], Iterable)
        return (";" if nested else ",").join(_text(option, item) for item in items)
    raise TypeError(f"{option} is a {type(value).__name__}: give a number, a text or a list")


def _paths(inputs: Inputs) -> list[str]:
    several = [inputs] if isinstance(inputs, (str, os.PathLike)) else inputs
    paths = [os.fspath(path) for path in several]
    if not paths:
        raise OptionError("inputs is empty: give at least one file, directory or pattern", "inputs")
    return paths


def _paths_or_points(cloud: Any, file: Path) -> list[str]:
    """Returns paths as they are; points are written to `file`."""
    is_path = isinstance(cloud, (str, os.PathLike))
    is_list = isinstance(cloud, (list, tuple)) and cloud
    if is_path or (is_list and all(isinstance(item, (str, os.PathLike)) for item in cloud)):
        return _paths(cloud)
    positions = np.ascontiguousarray(read(cloud).positions, dtype="<f8")
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n{axes}end_header\n"
    with file.open("wb") as to:
        to.write(head.encode())
        to.write(positions.data)
    return [str(file)]
