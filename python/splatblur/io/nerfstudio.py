"""nerfstudio: `transforms.json`, which instant-ngp and `splatblur dataset` write, too."""

from __future__ import annotations

import json
import math
import os
from os import PathLike, fspath
from typing import Any

import numpy as np

from ._views import Views, refused, sorted_views

_DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")


def views(path: str | PathLike[str]) -> Views:
    """The photographs of a `transforms.json`.

    Args:
        path: The file, or the folder that it is in. Distortion is left out: see `Views.distorted`.

    Raises:
        ModelError: The file is missing or not valid.
    """
    path = fspath(path)
    file = os.path.join(path, "transforms.json") if os.path.isdir(path) else path
    if not os.path.exists(file):
        raise refused(path, "no transforms.json", "the file, or a folder with it")
    with open(file, encoding="utf-8") as opened:
        try:
            data = json.load(opened)
        except (ValueError, RecursionError) as why:
            raise refused(file, "no JSON", f"JSON ({why})") from why
    frames = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(frames, list):
        raise refused(file, "no list `frames`", "a list of frames")
    return sorted_views([_frame(file, data, frame, number) for number, frame in enumerate(frames)])


def _frame(file: str, data: dict[str, Any], frame: Any, number: int) -> tuple[str, Any, Any, tuple[int, int], bool]:
    where = f"frames[{number}]"
    if not isinstance(frame, dict):
        raise refused(file, f"{where}, which is no object", "an object")
    given = {**data, **frame}

    def value(name: str) -> float | None:
        found = given.get(name)
        if found is None:
            return None
        if isinstance(found, bool) or not isinstance(found, (int, float)) or not math.isfinite(found):
            raise refused(file, f"`{name}` of {where}, {found!r}"[:200], "a finite number")
        return float(found)

    width, height = value("w"), value("h")
    if width is None or height is None or not (1 <= width <= 65_535 and 1 <= height <= 65_535):
        raise refused(file, f"the size {width} x {height} of {where}", "`w` and `h`, pixels")
    angle_x = value("camera_angle_x")
    fx = value("fl_x") or (0.5 * width / math.tan(0.5 * angle_x) if angle_x else None)
    fy = value("fl_y") or fx
    if fx is None or fy is None or fx <= 0.0 or fy <= 0.0:
        raise refused(file, f"no focal length of {where}", "`fl_x` and `fl_y`, pixels, or `camera_angle_x`")
    cx, cy = value("cx"), value("cy")
    K = [[fx, 0.0, 0.5 * width if cx is None else cx], [0.0, fy, 0.5 * height if cy is None else cy], [0.0, 0.0, 1.0]]
    try:
        matrix = np.array(frame.get("transform_matrix"), np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise refused(file, f"no `transform_matrix` of {where}", "four rows of four finite numbers")
    name = str(frame.get("file_path", f"{number}"))
    return name, matrix, K, (int(width), int(height)), any(value(key) for key in _DISTORTION)
