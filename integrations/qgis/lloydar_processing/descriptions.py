"""What the algorithms are called, take and give: identifiers, parameters, help. No QGIS is imported here.

Models and scripts of users name algorithms and parameters, so these names are frozen: a test holds them. A new
parameter must be optional.
"""

from __future__ import annotations

from dataclasses import dataclass, field

PROVIDER = "lloydar"


@dataclass(frozen=True)
class Parameter:
    """A parameter of an algorithm, and the option of the program that it becomes."""

    name: str
    #: "files", "file", "text", "integer", "choice", "choices", "switch", "extent" or "output".
    kind: str
    label: str
    #: A sentence that says what the value means, with its unit.
    help: str
    #: The option of the program, or "" for a parameter that is no option.
    option: str = ""
    default: object = None
    optional: bool = True
    advanced: bool = False
    #: Words of the program, for the kinds "choice" and "choices".
    choices: tuple[str, ...] = ()
    #: File types of the kinds "file" and "output", in the notation of Qt.
    filter: str = ""
    minimum: int | None = None


@dataclass(frozen=True)
class Algorithm:
    """An algorithm of the provider, and the command of the program that it runs."""

    identifier: str
    title: str
    command: str
    help: str
    parameters: tuple[Parameter, ...]
    #: Names of the figures that it returns, with what they mean.
    figures: dict[str, str] = field(default_factory=dict)
    tags: tuple[str, ...] = ()

    def parameter(self, name: str) -> Parameter:
        """Return the parameter `name`."""
        return next(parameter for parameter in self.parameters if parameter.name == name)


SCANS = "Point clouds (*.laz *.las *.ply *.e57 *.LAZ *.LAS *.PLY *.E57)"
CLOUDS_OUT = "COPC (*.copc.laz);;LAZ (*.laz);;LAS (*.las);;PLY (*.ply)"

INPUT = Parameter(
    "INPUT",
    "files",
    "Scans",
    "One or more LAS, LAZ, COPC or PLY files, or directories of LAS and LAZ files. All have one CRS, with lengths "
    "as units: degrees are refused.",
    optional=False,
    filter=SCANS,
)
DENSITY = (
    Parameter(
        "SPACING",
        "text",
        "Spacing",
        "Distance between neighbouring points of the output: a number in units of the CRS (0.05), or with a unit "
        "(5cm, 0.2ft). Give one of spacing, count and ratio.",
        "--spacing",
    ),
    Parameter(
        "COUNT",
        "text",
        "Number of points",
        "Number of points of the output: 100K, 2M, 1500000. It is met within 0.3 per cent.",
        "--count",
    ),
    Parameter(
        "RATIO",
        "text",
        "Ratio",
        "Points of the output for each point of the input: 2% or 0.02.",
        "--ratio",
    ),
)
#: Names of which at most one may be given.
ONE_OF = tuple(parameter.name for parameter in DENSITY)

SELECTION = (
    Parameter(
        "KEEP_CLASS",
        "text",
        "Classes to keep",
        "Numbers of LAS classes, such as 2,6: other points are left out. All classes if empty.",
        "--keep-class",
        advanced=True,
    ),
    Parameter(
        "DROP_CLASS",
        "text",
        "Classes to leave out",
        "Numbers of LAS classes, such as 7,18.",
        "--drop-class",
        advanced=True,
    ),
    Parameter(
        "EXTENT",
        "extent",
        "Extent",
        "Points outside of this rectangle are left out. It is in the CRS of the scans, in its units.",
        "--bounds",
        advanced=True,
    ),
    Parameter(
        "POLYGON",
        "file",
        "Polygons",
        "Well-known text or GeoJSON with polygons in the CRS of the scans: points outside of them are left out.",
        "--polygon",
        advanced=True,
        filter="Polygons (*.geojson *.json *.wkt *.txt)",
    ),
)
SOLVER = (
    Parameter(
        "SMOOTH",
        "text",
        "Smoothing radius",
        "Radius of the surface fit, in units of the CRS or with a unit (5cm). A larger one smooths noise away. "
        "1.2 spacings if empty.",
        "--smooth",
        advanced=True,
    ),
    Parameter(
        "FILL",
        "text",
        "Widest hole to close",
        "Width in units of the CRS or with a unit (20cm); 0 leaves all holes open. 4 spacings if empty.",
        "--fill",
        advanced=True,
    ),
    Parameter(
        "ISOLATED",
        "choice",
        "Isolated returns",
        "Rain, birds and echoes: keep them, drop them, or mark them with class 7 (noise).",
        "--isolated",
        default="keep",
        choices=("keep", "drop", "mark"),
        advanced=True,
    ),
    Parameter(
        "COLOR",
        "choice",
        "Colour and intensity",
        "Of the nearest point of the scan, or the mean of the points around.",
        "--color",
        default="nearest",
        choices=("nearest", "mean"),
        advanced=True,
    ),
    Parameter(
        "CLASS",
        "choice",
        "Class",
        "Of the nearest point of the scan, or the most frequent one of the points around.",
        "--class",
        default="nearest",
        choices=("nearest", "majority"),
        advanced=True,
    ),
    Parameter(
        "ATTRIBUTES",
        "choices",
        "More attributes",
        "Normals (unit vectors), mean curvature (1 / unit of the CRS), area of the Voronoi cell (square units), "
        "density of the scan (points per square unit), distance to the scan (units of the CRS).",
        "--with",
        choices=("normals", "curvature", "area", "density", "distance", "spacing"),
        advanced=True,
    ),
)
TRANSIENTS = Parameter(
    "TRANSIENTS",
    "choice",
    "Cars and people that have gone",
    "What one pass of a mobile survey saw and other passes looked through: keep it, or drop it. To drop it needs scans "
    "with GPS times, and the trajectory.",
    "--transients",
    default="keep",
    choices=("keep", "drop"),
    advanced=True,
)
TRAJECTORY = Parameter(
    "TRAJECTORY",
    "file",
    "Trajectory",
    "CSV file with the columns time, x, y, z of a moving scanner: GPS time in seconds, units of the CRS. Cars and "
    "people that have gone are found by it, and a mesh looks towards it.",
    "--trajectory",
    advanced=True,
    filter="CSV (*.csv *.txt)",
)
RESOURCES = (
    Parameter(
        "MEMORY",
        "text",
        "Memory",
        "Peak memory: 512MiB, 4GiB. The points do not depend on it. Three quarters of the machine's if empty.",
        "--memory",
        advanced=True,
    ),
    Parameter(
        "THREADS",
        "integer",
        "Threads",
        "Number of worker threads; one per core if empty.",
        "--threads",
        advanced=True,
        minimum=1,
    ),
    Parameter(
        "OPTIONS",
        "text",
        "Further options",
        "Options of `lloydar run` that have no field here, as in a terminal: --iterations 30 --crs EPSG:32633",
        advanced=True,
    ),
    Parameter(
        "RESTART",
        "switch",
        "Begin anew",
        "Delete what an earlier run with the same output left behind, instead of continuing it.",
        "--restart",
        default=False,
        advanced=True,
    ),
)
LOAD = Parameter(
    "LOAD",
    "switch",
    "Load the results into the project",
    "Add the results as layers. Clouds need a QGIS with PDAL, and the format LAS, LAZ or COPC.",
    default=True,
)
CLOUD = Parameter(
    "OUTPUT",
    "output",
    "Even cloud",
    "The file to write: .copc.laz, .laz, .las or .ply. An existing one is replaced. A report and a viewer, "
    "which are pages for a browser, are written beside it.",
    "--output",
    filter=CLOUDS_OUT,
    optional=False,
)
RESUMING = (
    "Cancel stops the job and keeps what is done in a directory beside the output; the same call with the same output "
    "continues it, to the same points."
)
JOB_FIGURES = {"POINTS": "Number of points of the output", "SPACING_USED": "Spacing of the output, in units of the CRS"}

RESAMPLE = Algorithm(
    "resample",
    "Resample to even points",
    "run",
    "Moves the points of laser scans to even positions on the scanned surfaces, within a memory budget. " + RESUMING,
    (INPUT, *DENSITY, *SELECTION, *SOLVER, TRANSIENTS, TRAJECTORY, *RESOURCES, LOAD, CLOUD),
    JOB_FIGURES,
    ("thin", "decimate", "subsample", "uniform", "lidar", "point cloud", "poisson", "spacing"),
)
MESH = Algorithm(
    "mesh",
    "Mesh of even points",
    "run",
    "Resamples laser scans and writes triangles between the even points, without seams, larger than memory. "
    + RESUMING,
    (
        INPUT,
        *DENSITY,
        *SELECTION,
        *SOLVER,
        TRANSIENTS,
        Parameter(
            "MESH_OF",
            "choice",
            "Points that have triangles",
            "Those on surfaces, or all, on wires and leaves, too.",
            "--mesh-of",
            default="surfaces",
            choices=("surfaces", "all"),
            advanced=True,
        ),
        Parameter(
            "SCANNER",
            "text",
            "Places of scanners",
            "Places towards which the mesh looks, in units of the CRS: x,y,z or x,y,z;x,y,z. Upwards, or outwards, "
            "if empty.",
            "--scanner",
            advanced=True,
        ),
        TRAJECTORY,
        *RESOURCES,
        LOAD,
        CLOUD,
        Parameter(
            "MESH",
            "output",
            "Mesh",
            "The file to write: .ply (which QGIS shows as a mesh layer), .obj or .glb. An existing one is replaced.",
            "--mesh",
            filter="PLY (*.ply);;OBJ (*.obj);;GLB (*.glb)",
            optional=False,
        ),
    ),
    {**JOB_FIGURES, "TRIANGLES": "Number of triangles"},
    ("triangulate", "surface", "tin", "lidar", "point cloud"),
)
MEASURE = Algorithm(
    "measure",
    "Measure the evenness of a cloud",
    "measure",
    "Computes how even a cloud is, and how near to its scan, whatever program made it.",
    (
        Parameter(
            "INPUT",
            "files",
            "Cloud",
            "LAS, LAZ, COPC or PLY files of the cloud. It must fit into memory: 24 bytes a point.",
            optional=False,
            filter=SCANS,
        ),
        Parameter(
            "AGAINST",
            "files",
            "Scans",
            "The scans that the cloud was made from: adds the distances between them, in units of the CRS.",
            "--against",
            filter=SCANS,
        ),
        Parameter("MEMORY", "text", "Memory", "Peak memory: 512MiB, 4GiB.", "--memory", advanced=True),
        Parameter(
            "OUTPUT",
            "output",
            "Figures",
            "A JSON file with all figures.",
            filter="JSON (*.json)",
        ),
    ),
    {
        "POINTS": "Number of points",
        "SPACING_USED": "Spacing of a hexagonal lattice with as many points to the area, in units of the CRS",
        "DELTA": "Deviation of the nearest distances over their mean; 0 is the best",
        "ENERGY_RATIO": "Energy of the Voronoi cells over that of the hexagonal lattice; 1 is the best",
        "CELL_AREA_CV": "Deviation of the areas of the cells over their mean; 0 is the best",
        "PACKING": "Least distances over those of the hexagonal lattice; 1 is the best",
        "MEAN_DISTANCE": "Mean distance from the cloud to the scans, in units of the CRS",
        "MAX_DISTANCE": "Greatest distance from the cloud to the scans, in units of the CRS",
    },
    ("quality", "uniformity", "density", "compare", "lidar", "point cloud"),
)
RENDER = Algorithm(
    "render",
    "Picture of a cloud",
    "render",
    "Draws a cloud as a picture, without a graphics card. The picture is not a map: it has a view, not a CRS.",
    (
        Parameter(
            "INPUT",
            "files",
            "Clouds",
            "LAS, LAZ, COPC or PLY files.",
            optional=False,
            filter=SCANS,
        ),
        Parameter(
            "VIEW",
            "choice",
            "View",
            "From the top, oblique, or street: from within, along the longer side.",
            "--view",
            default="oblique",
            choices=("top", "oblique", "street"),
        ),
        Parameter(
            "BY",
            "choice",
            "Colours",
            "Those of the points (auto; heights if there are none), or by height, intensity or class.",
            "--by",
            default="auto",
            choices=("auto", "height", "intensity", "class"),
        ),
        Parameter("SIZE", "text", "Size", "Width and height in pixels: 1600x900.", "--size", default="1600x900"),
        Parameter(
            "POINT_SIZE",
            "text",
            "Diameter of the points",
            "In units of the CRS; by the density of the points if empty.",
            "--point-size",
            advanced=True,
        ),
        Parameter(
            "OUTPUT",
            "output",
            "Picture",
            "The picture to write. An existing one is replaced.",
            "--output",
            filter="PNG (*.png)",
            optional=False,
        ),
    ),
    {},
    ("draw", "image", "png", "preview", "lidar", "point cloud"),
)
INFO = Algorithm(
    "info",
    "Information about scans",
    "info",
    "Reads the headers of scans: format, number of points, extent, scale, CRS, and whatever is unusual in them.",
    (
        INPUT,
        Parameter(
            "OUTPUT",
            "output",
            "Headers",
            "A JSON file with a list of the headers; lengths are in units of the CRS.",
            filter="JSON (*.json)",
        ),
    ),
    {"FILES": "Number of files", "POINTS": "Number of points of all files, as their headers state it"},
    ("header", "metadata", "crs", "lidar", "point cloud"),
)

ALGORITHMS = (RESAMPLE, MESH, MEASURE, RENDER, INFO)


def help_page(algorithm: Algorithm) -> str:
    """Return the help of an algorithm: what it does, and a sentence about each parameter."""
    lines = [f"<p>{algorithm.help}</p>"]
    lines += [f"<p><b>{parameter.label}</b>: {parameter.help}</p>" for parameter in algorithm.parameters]
    if algorithm.figures:
        rows = "".join(f"<li>{name}: {meaning}.</li>" for name, meaning in algorithm.figures.items())
        lines.append(f"<p>Figures that are returned:</p><ul>{rows}</ul>")
    return "".join(lines)
