"""HDF5: particles of simulations, as Gadget, SWIFT and openPMD write them. It needs h5py."""

from __future__ import annotations

import os
from os import PathLike, fspath
from typing import Any

import numpy as np

from ._table import Table
from ._views import refused

# Names of positions that programs use, the first that is there.
_POSITIONS: tuple[str | tuple[str, str, str], ...] = (
    "Coordinates", "positions", "position", "pos", ("position/x", "position/y", "position/z"), ("x", "y", "z"),
)


def read(
    path: str | PathLike[str],
    group: str = "/",
    *,
    positions: str | tuple[str, str, str] | None = None,
) -> Table:
    """The particles of a group. Columns are read when they are asked for, and the file is not kept open.

    Args:
        path: The file.
        group: The group of the particles, as in `/PartType0` (Gadget, SWIFT) or `/data/0/particles/e` (openPMD).
        positions: The data set of the positions (N, 3), or three of (N,). The default is what such programs write:
            `Coordinates`, `positions`, `position`, `pos`, `position/x` and so on, or `x`, `y`, `z`.

    Raises:
        ModelError: The file cannot be read, or has no such group or data set.
        ImportError: h5py is missing.
    """
    import h5py

    name = fspath(path)

    def opened() -> Any:
        try:
            return h5py.File(name, "r")
        except OSError as why:
            found = "no HDF5 file" if os.path.exists(name) else "no such file"
            raise refused(name, found, f"an HDF5 file ({why})") from why

    def column(key: str) -> Any:
        with opened() as file:
            return _values(name, file[group], key)

    with opened() as file:
        if group not in file or not isinstance(file[group], h5py.Group):
            raise refused(name, f"no group {group}", f"one of {', '.join(sorted(file))}")
        particles = file[group]
        wanted = (positions,) if positions is not None else _POSITIONS

        def there(name: str | tuple[str, str, str]) -> bool:
            parts = (name,) if isinstance(name, str) else name
            return all(isinstance(particles.get(part), h5py.Dataset) for part in parts)

        found = [each for each in wanted if there(each)]
        if not found:
            raise refused(name, f"no positions in {group}", f"positions= one of {', '.join(sorted(particles))}")
        sets: list[str] = []
        particles.visititems(lambda key, value: sets.append(key) if isinstance(value, h5py.Dataset) else None)
        return Table(_values(name, particles, found[0]), sets, column)


def _values(file: str, group: Any, key: str | tuple[str, str, str]) -> Any:
    if isinstance(key, tuple):
        return np.stack([_values(file, group, part) for part in key], axis=-1)
    try:
        values = group[key][()]
    except (OSError, TypeError, AttributeError, KeyError) as why:
        raise refused(file, f"{key}", f"a data set that can be read ({why})") from why
    unit = group[key].attrs.get("unitSI")
    # openPMD: numbers of the file times `unitSI` are SI units.
    return values if unit is None else values * unit
