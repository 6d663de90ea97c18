"""The simulated street, as many points of it as are asked for."""

from process import measured


def simulated(program, work, points):
    """The folder of a street of `points` (`500K`, `5M`); it is simulated if it is not there."""
    folder = work / f"street-{points}"
    if not folder.exists():
        measured([program, "simulate", "--points", points, "-o", folder])
    return folder
