"""Cameras of a capture: what COLMAP and nerfstudio know of its photographs."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .._camera import Camera
from .._errors import ModelError, invalid


def refused(file: object, found: str, expected: str, line: int | None = None) -> ModelError:
    """A file that is not what it should be."""
    where = f"{file}:{line}" if line is not None else f"{file}"
    return ModelError(f"{where}: found {found}, expected {expected}", file=str(file), line=line, found=found,
                      expected=expected)


def natural(name: str) -> list[Any]:
    """Digits count as numbers: 2.png stands before 10.png."""
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in re.split(r"(\d+)", name)]


@dataclass
class Views:
    """Photographs of a capture, in the order of their names, digits as numbers.

    Attributes:
        names: Names of the pictures.
        c2w: Camera to world, (T, 4, 4), OpenGL axes: x right, y up, the camera looks along -z.
        K: Intrinsics, (T, 3, 3), pixels.
        sizes: Width and height of each picture, pixels.
        distorted: Names of pictures whose lens has distortion, which is left out.
    """

    names: list[str]
    c2w: npt.NDArray[np.float64]
    K: npt.NDArray[np.float64]
    sizes: list[tuple[int, int]]
    distorted: list[str]

    def __len__(self) -> int:
        return len(self.names)

    def _lens(self, index: int, size: tuple[int, int] | None) -> tuple[tuple[int, int], npt.NDArray[np.float64]]:
        """Intrinsics for a picture of another size: the height is kept, as `size` of `load` does."""
        own = self.sizes[index]
        if size is None:
            return own, self.K[index]
        share = size[1] / own[1]
        K = self.K[index] * share
        K[2, 2] = 1.0
        K[0, 2] = (self.K[index][0, 2] / own[0]) * size[0]
        return size, K

    def camera(
        self,
        times: npt.ArrayLike | None = None,
        *,
        size: tuple[int, int] | None = None,
        near: float = 0.01,
    ) -> Camera:
        """A camera that goes through all views, with the lens of the first.

        Args:
            times: Frame number of each view, (T,), rising. The default is 0, 1, 2, ...
            size: Width and height of the image, pixels, in place of the photographs'.
            near: Nearest visible depth, scene units.
        """
        if not self.names:
            raise invalid("views", "empty", "at least one")
        (width, height), K = self._lens(0, size)
        times = np.arange(len(self)) if times is None else times
        return Camera(width, height, K=K, c2w=self.c2w, times=times, near=near)

    def cameras(self, *, size: tuple[int, int] | None = None, near: float = 0.01) -> list[Camera]:
        """A camera at each view, with its own lens."""
        lenses = [self._lens(index, size) for index in range(len(self))]
        return [Camera(*own, K=K, c2w=c2w, near=near) for (own, K), c2w in zip(lenses, self.c2w, strict=True)]


def sorted_views(rows: list[tuple[str, Any, Any, tuple[int, int], bool]]) -> Views:
    """Views of (name, c2w, K, size, distorted)."""
    rows = sorted(rows, key=lambda row: natural(row[0]))
    return Views(
        [row[0] for row in rows],
        np.array([row[1] for row in rows], np.float64).reshape(-1, 4, 4),
        np.array([row[2] for row in rows], np.float64).reshape(-1, 3, 3),
        [row[3] for row in rows],
        [row[0] for row in rows if row[4]],
    )
