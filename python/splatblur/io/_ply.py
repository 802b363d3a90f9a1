"""Captures as the PLY files of Kerbl et al. 2023."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

_MOST_LOGIT = 30.0


def write_gaussians(path: str, columns: dict[str, Any]) -> None:
    """Writes the columns of a native capture. The file appears whole or not at all."""
    count, degree = len(columns["position"]), columns["degree"]
    each = (degree + 1) ** 2 - 1
    opacity = columns["opacity"].astype(np.float64)
    with np.errstate(divide="ignore"):
        logit = np.clip(np.log(opacity) - np.log1p(-opacity), -_MOST_LOGIT, _MOST_LOGIT)
        scales = np.log(np.maximum(columns["sigma"].astype(np.float64), 1e-30))
    # The file has all coefficients of red, then those of green and of blue.
    rest = columns["harmonics"].reshape(count, each, 3).transpose(0, 2, 1).reshape(count, 3 * each)
    x, y, z, w = columns["rotation"].T
    values = np.column_stack([columns["position"], columns["base"], rest, logit, scales, w, x, y, z])
    names = ["x", "y", "z", *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(3 * each)), "opacity"]
    names += [*(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    head += [f"property float {name}" for name in names] + ["end_header", ""]
    beside = f"{path}.{os.getpid()}.part"
    with open(beside, "wb") as file:
        file.write("\n".join(head).encode("ascii"))
        file.write(values.astype("<f4").tobytes())
    os.replace(beside, path)
