"""gsplat: checkpoints of its trainer."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any, Mapping

import numpy as np

from .. import _arrays
from .._objects import Gaussians
from ._views import refused

_KEYS = ("means", "quats", "scales", "opacities", "sh0", "shN")


def load(checkpoint: str | PathLike[str] | Mapping[str, Any], *, antialiased: bool = False) -> Gaussians:
    """A capture of a checkpoint: parameters as they are trained, with logarithms of scales and logits of opacities.

    Args:
        checkpoint: A `.pt` file (torch is needed), a `.npz` file, or the dict itself; `splats` in it is found. Its
            keys are `means` (N, 3), `quats` (N, 4) w first, `scales` (N, 3), `opacities` (N,), `sh0` (N, 1, 3) and
            `shN` (N, K - 1, 3), which may be missing.
        antialiased: It was trained with `rasterize_mode="antialiased"`.

    Raises:
        ModelError: The file is no checkpoint.
        InvalidValue: A column has a wrong shape, or values that are not finite.
    """
    name = "the checkpoint" if isinstance(checkpoint, Mapping) else fspath(checkpoint)
    data: Any = checkpoint if isinstance(checkpoint, Mapping) else _read(name)
    splats = data.get("splats", data) if isinstance(data, Mapping) else None
    if not isinstance(splats, Mapping) or any(key not in splats for key in _KEYS[:5]):
        raise refused(name, "other keys", f"a dict with {', '.join(_KEYS)}")
    columns = {key: _arrays.real(splats[key], key).astype(np.float64) for key in _KEYS if key in splats}
    with np.errstate(over="ignore"):
        scales, opacities = np.exp(columns["scales"]), 1.0 / (1.0 + np.exp(-columns["opacities"]))
    sh = columns["sh0"]
    if "shN" in columns and columns["shN"].size:
        if columns["shN"].ndim != 3 or columns["shN"].shape[::2] != sh.shape[::2]:
            raise refused(name, f"shN of shape {columns['shN'].shape}", f"(N, K - 1, 3) beside sh0 {sh.shape}")
        sh = np.concatenate([sh, columns["shN"]], axis=1)
    return Gaussians(columns["means"], columns["quats"], scales, opacities.reshape(-1), sh=sh, antialiased=antialiased)


def _read(path: str) -> Any:
    if path.endswith(".npz"):
        try:
            with np.load(path, allow_pickle=False) as file:
                return {key: file[key] for key in file.files}
        except (OSError, ValueError) as why:
            raise refused(path, "no such file", f"a .npz file ({why})") from why
    import torch

    try:
        # Without code of the file: a checkpoint may come from anybody.
        return torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise
    except Exception as why:
        raise refused(path, "no such file", f"a checkpoint of torch ({why})"[:500]) from why
