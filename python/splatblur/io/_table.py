"""Columns of a file as points."""

from __future__ import annotations

from typing import Any, Callable, Literal

import numpy as np
import numpy.typing as npt

from .. import _arrays
from .._colour import colour_map
from .._errors import invalid
from .._objects import Points

Column = str | npt.ArrayLike | None


class Table:
    """Positions, and columns by their names.

    Attributes:
        positions: Positions, (N, 3).
        names: Names of the columns.
    """

    def __init__(self, positions: Any, names: list[str], read: Callable[[str], Any]) -> None:
        self.positions = _arrays.column(positions, "positions", None, 3)
        self.names = names
        self._read = read

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"<splatblur.io table: {len(self)} points with {', '.join(self.names) or 'no columns'}>"

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """A column by its name."""
        if name not in self.names:
            raise invalid("column", f"{name!r}"[:200], f"a column of the file ({', '.join(self.names)})")
        return _arrays.numpy_of(self._read(name), name)

    def points(
        self,
        *,
        colour_by: Column = None,
        color_by: Column = None,
        map: str = "viridis",
        range: tuple[float, float] | None = None,
        velocities: Column = None,
        accelerations: Column = None,
        velocity_unit: Literal["second", "frame"] = "second",
        radii: Column = None,
        normals: Column = None,
        opacities: Column = None,
        ids: Column = None,
        colours: Column = None,
        colors: Column = None,
        **options: Any,
    ) -> Points:
        """Points of the table. Each column is a name in the file, or an array.

        Args:
            colour_by: The column that decides colours; of several numbers a point its length does. `"speed"` is the
                length of the velocities, where the file has no column of that name.
            color_by: The same.
            map: The colour map, as in `splatblur.colour_map`.
            range: The values of its ends.
            velocities: As in `Points`, as are all others.
            accelerations: As in `Points`.
            velocity_unit: As in `Points`.
            radii: As in `Points`.
            normals: As in `Points`.
            opacities: As in `Points`.
            ids: As in `Points`.
            colours: As in `Points`.
            colors: As in `Points`.
            options: `two_sided`.
        """
        by = _arrays.one_of(colour_by, color_by, "colour_by", "color_by")
        own = self._column(_arrays.one_of(colours, colors, "colours", "colors"))
        if by is not None:
            is_speed = isinstance(by, str) and by == "speed" and by not in self.names and velocities is not None
            values = _arrays.real(self._column(velocities if is_speed else by), "colour_by")
            if values.ndim == 2:
                values = np.linalg.norm(values, axis=1)
            own = colour_map(values, map, range)
        return Points(
            self.positions,
            colours=own,
            velocities=self._column(velocities),
            accelerations=self._column(accelerations),
            velocity_unit=velocity_unit,
            radii=self._column(radii),
            normals=self._column(normals),
            opacities=self._column(opacities),
            ids=self._column(ids),
            **options,
        )

    def _column(self, column: Column) -> Any:
        return self[column] if isinstance(column, str) else column
