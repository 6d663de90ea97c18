from collections.abc import Mapping, Sequence
from typing import Any, Final, final

import numpy as np
import numpy.typing as npt

__all__ = ["Rings", "Task", "__version__", "call", "main", "resample"]

__version__: Final[str]

@final
class Task:
    def wait(self, seconds: float) -> bool: ...
    def cancel(self) -> None: ...
    def reports(self) -> tuple[dict[str, Any], list[str]]: ...
    def result(self) -> Any: ...

@final
class Rings:
    def of(self, index: int) -> tuple[npt.NDArray[np.uint32], bool]: ...
    def triangles(
        self, points: npt.NDArray[np.float64], normals: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.uint32]: ...

def resample(
    points: npt.NDArray[np.float64] | npt.NDArray[np.float32],
    options: Mapping[str, Any],
    *,
    threads: int | None = None,
) -> Task: ...
def call(
    words: Sequence[str], *, output: str | None = None, threads: int | None = None
) -> Task: ...
def main(arguments: Sequence[str]) -> int: ...
