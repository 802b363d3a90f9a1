"""What is in a scene: points, captures, files, and objects that place and move them."""

from __future__ import annotations

import os
import re
import sys
import warnings
from os import PathLike, fspath
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _arrays, _loaded, _native
from ._errors import Fixed, ForkedLazily, NoteWarning, invalid
from ._native import Object as NativeObject

Path = str | PathLike[str]

_HERE = os.path.dirname(os.path.abspath(__file__)) + os.sep


def tell(notes: list[str]) -> None:
    """Hands out notes as warnings, which name the line outside this package that led to them."""
    if not notes:
        return
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        level, frame = level + 1, frame.f_back
    for note in notes:
        warnings.warn(note, NoteWarning, stacklevel=level)


class Model(ForkedLazily):
    """What an object is made of. Models do not change, and objects share them.

    `Points` and `Gaussians` are models of arrays; `Model.load` reads a file.

    Attributes:
        kind: `surfels`, `gaussians`, `volume` or `sequence`.
        notes: What was estimated or dropped, one line each. They are warnings, too.
    """

    _native: NativeObject
    _file: tuple[str, str | None] | None = None

    def __init__(self) -> None:
        raise TypeError("use Points(...), Gaussians(...) or Model.load(path)")

    @classmethod
    def load(cls, path: Path, *, kind: Literal["surfels", "gaussians"] | None = None) -> Model:
        """Reads a model file: points, a mesh, a capture or a volume, in any format that the program reads.

        Args:
            path: The file: PLY, .sfl, .obj, .xyz, .pts, .las, .laz, .e57, .bin, glTF, .splat, .spz, .sog, .nrrd.
            kind: Makes `surfels` of a capture, or insists on `gaussians`. `None`: what the file is.

        Raises:
            ModelError: The file cannot be read, or is not a valid model.
        """
        return Model._of_file(fspath(path), kind)

    @staticmethod
    def _of_file(path: str, kind: str | None) -> Model:
        if _native.is_forked():
            return object.__new__(Model)
        model = Model._of(_native.Object.load(path, kind))
        model._file = (path, kind)
        tell(model.notes)
        return model

    @staticmethod
    def _of(native: NativeObject) -> Model:
        model = object.__new__(Model)
        model._native = native
        return model

    @property
    def kind(self) -> str:
        """`surfels`, `gaussians`, `volume` or `sequence`."""
        return self._native.kind

    @property
    def notes(self) -> list[str]:
        """What was estimated, replaced or dropped, one line each."""
        return self._native.notes

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """Box around the centres in model space, (2, 3): least and greatest corner."""
        return np.array(self._native.bounds)

    def __len__(self) -> int:
        return self._native.elements

    def __repr__(self) -> str:
        return f"<splatblur.{type(self).__name__}: {len(self)} {self.kind}>"

    def __reduce__(self) -> tuple[Any, ...]:
        if self._file is not None:
            return Model._of_file, self._file
        columns = self._native.columns()
        if columns is None:
            raise TypeError(f"a {self.kind} cannot be pickled alone: pickle its scene")
        return _of_columns, (type(self), columns)


def _of_columns(cls: type[Model], columns: dict[str, Any]) -> Model:
    model = object.__new__(cls)
    if not _native.is_forked():
        model._native = _native.Object.of_columns(columns)
    return model


class Points(Model):
    """Points of a surface, which become surfels: discs with a normal, a radius and a colour.

    Missing normals and radii are estimated from neighbours; a warning says so. Points whose position is not finite are
    dropped, with a warning, and other numbers that cannot be drawn are replaced: a radius that is negative, an opacity
    above 1, a velocity that is not finite. Arrays are copied once, so they may be changed or freed afterwards. Any array
    type will do: numpy, tensors by `__dlpack__` or `__array__`, lists. One row stands for all points: (3,) or (1, 3)
    where (N, 3) is asked for, one number where (N,) is.

    Args:
        positions: Positions, (N, 3), model units. float64 keeps its precision: positions are recentred.
        normals: Outward normals, (N, 3), of any length.
        radii: Radii, (N,), model units: where a surfel's kernel ends.
        colors: Linear Rec.709 light, (N, 3), at least 0, and at most 1 for what reflects. `srgb_to_linear` decodes
            sRGB values.
        colours: The same.
        opacities: Opacities, (N,), 0 to 1.
        velocities: Velocities, (N, 3), model units per `velocity_unit`.
        accelerations: Accelerations, (N, 3), model units per `velocity_unit` squared.
        velocity_unit: `"second"` or `"frame"`.
        ids: Identities, (N,), whole numbers.
        two_sided: Show both sides, for normals whose signs mean nothing.

    Raises:
        InvalidValue: A column has a wrong shape or dtype, a colour is negative or too large for a picture, or a velocity
            is beyond 1e18.
        ModelError: No point is left that can be drawn.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        *,
        normals: npt.ArrayLike | None = None,
        radii: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        colours: npt.ArrayLike | None = None,
        opacities: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        accelerations: npt.ArrayLike | None = None,
        velocity_unit: Literal["second", "frame"] = "second",
        ids: npt.ArrayLike | None = None,
        two_sided: bool = False,
    ) -> None:
        if velocity_unit not in ("second", "frame"):
            raise invalid("velocity_unit", f"{velocity_unit!r}"[:200], "'second' or 'frame'")
        columns: dict[str, Any] = {"positions": _arrays.column(positions, "positions", None, 3)}
        rows = len(columns["positions"])
        colours = _arrays.one_of(colours, colors, "colours", "colors")
        if colours is not None:
            columns["colours"] = _arrays.colours(colours, "colours", rows)
        if ids is not None:
            columns["ids"] = _arrays.whole(ids, "ids", rows)
        vectors = {"normals": normals, "velocities": velocities, "accelerations": accelerations}
        for name, value in vectors.items():
            if value is not None:
                columns[name] = _arrays.column(value, name, rows, 3)
        for name, value in {"radii": radii, "opacities": opacities}.items():
            if value is not None:
                columns[name] = _arrays.column(value, name, rows, None)
        self._native = _native.Object.points(columns, velocity_unit, _arrays.flag(two_sided, "two_sided"))
        tell(self.notes)


class Gaussians(Model):
    """A capture: transparent 3D Gaussians, with gsplat's names and shapes.

    Args:
        means: Centres, (N, 3), model units.
        quats: Rotations, (N, 4), w first, of any length but 0.
        scales: Standard deviations along the three axes, (N, 3), model units: not their logarithms.
        opacities: Opacities, (N,), 0 to 1: not their logits.
        sh: Coefficients of spherical harmonics, (N, K, 3) with K = 1, 4, 9 or 16.
        colors: Colours in place of `sh`, (N, 3).
        colours: The same.
        linear: Colours are linear light. Captures are trained with sRGB-encoded ones, which is the default.
        antialiased: The capture was trained with an antialiased rasteriser.

    Raises:
        InvalidValue: A column has a wrong shape or dtype, or values out of bounds.
    """

    def __init__(
        self,
        means: npt.ArrayLike,
        quats: npt.ArrayLike,
        scales: npt.ArrayLike,
        opacities: npt.ArrayLike,
        *,
        sh: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        colours: npt.ArrayLike | None = None,
        linear: bool = False,
        antialiased: bool = False,
    ) -> None:
        columns: dict[str, Any] = {"means": _arrays.column(means, "means", None, 3)}
        rows = len(columns["means"])
        columns["quats"] = _arrays.column(quats, "quats", rows, 4)
        columns["scales"] = _arrays.column(scales, "scales", rows, 3)
        columns["opacities"] = _arrays.column(opacities, "opacities", rows, None)
        colours = _arrays.one_of(colours, colors, "colours", "colors")
        degree = 0
        if (sh is None) == (colours is None):
            raise TypeError("give the colours of Gaussians as `sh` or as `colours`: one of them")
        if sh is None:
            columns["colours"] = _arrays.column(colours, "colours", rows, 3)
        else:
            coefficients = _arrays.real(sh, "sh")
            degrees = {1: 0, 4: 1, 9: 2, 16: 3}
            shape = coefficients.shape
            if len(shape) != 3 or shape[0] != rows or shape[1] not in degrees or shape[2] != 3:
                raise invalid("sh", f"of shape {shape}", f"the shape ({rows}, K, 3) with K = 1, 4, 9 or 16")
            degree = degrees[shape[1]]
            columns["sh"] = _arrays.ready(coefficients)
        flags = _arrays.flag(linear, "linear"), _arrays.flag(antialiased, "antialiased")
        self._native = _native.Object.gaussians(columns, degree, *flags)

    @classmethod
    def load(cls, path: Path, *, kind: Literal["surfels", "gaussians"] | None = "gaussians") -> Model:
        """Reads a capture: PLY, compressed PLY, .splat, .spz, .sog or .glb.

        Args:
            path: The file.
            kind: As in `Model.load`.

        Raises:
            ModelError: The file cannot be read, or is no capture.
        """
        return Model._of_file(fspath(path), kind)


class SceneModel(Model):
    """What an object of a scene file is made of."""

    def __init__(self, scene: _loaded.LoadedScene, index: int) -> None:
        self._scene = scene
        self._index = index
        if not _native.is_forked():
            self._native = scene.native.objects[index]

    def __reduce__(self) -> tuple[Any, ...]:
        return SceneModel, (self._scene, self._index)


class Object(ForkedLazily, Fixed):
    """A model in a scene, with its place, motion and look.

    A point of the model goes through `transform`, and then through the poses.

    Args:
        model: Points, Gaussians, another model, or the path of a model file.
        name: A name that no other object of the scene has, in one line.
        transform: Model to world before any motion, (4, 4): translation, rotation and scales.
        poses: `(times, matrices)`: frame numbers (T,), rising, and matrices (T, 4, 4) that take the space of the model
            (after `transform`) to the world. Between two poses the object moves at constant speed and turns the
            shorter way; before the first and after the last it rests.
        velocity: Constant velocity, scene units a frame, in place of poses. At frame 0 it changes nothing.
        blur: False: the object is posed at the frame number, and is not blurred.
        cast_shadows: False: it keeps no light from anything.
        receive_shadows: False: no shadows fall on its surfels or Gaussians.
        shadow_catcher: True: nothing of it shows but the shadows on it, as black with alpha.
        opacity: A factor on all opacities, 0 to 1.
        material: Coefficients (ambient, diffuse, specular, shininess) of surfels.

    Raises:
        InvalidValue: A matrix is singular, sheared or not finite, some poses mirror and some do not, times do not rise,
            or a value is out of bounds.
    """

    def __init__(
        self,
        model: Model | Path,
        *,
        name: str = "",
        transform: npt.ArrayLike | None = None,
        poses: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        velocity: npt.ArrayLike | None = None,
        blur: bool = True,
        cast_shadows: bool = True,
        receive_shadows: bool = True,
        shadow_catcher: bool = False,
        opacity: float = 1.0,
        material: npt.ArrayLike | None = None,
    ) -> None:
        if not isinstance(model, (Model, str, PathLike)):
            raise invalid("model", f"a {type(model).__name__}", "Points, Gaussians, a Model or the path of a file")
        self._model = model if isinstance(model, Model) else Model.load(model)
        self._native = self._model._native
        self._changes: dict[str, Any] = {}
        if poses is not None and velocity is not None:
            raise TypeError("give an object `poses` or a `velocity`, not both")
        given = {"name": name, "blur": blur, "opacity": opacity}
        given |= {"receive_shadows": receive_shadows, "shadow_catcher": shadow_catcher}
        given |= {"cast_shadows": cast_shadows}
        given |= {"transform": transform, "poses": poses, "velocity": velocity, "material": material}
        for key, value in given.items():
            if value is not None:
                self._change(key, value)

    @classmethod
    def _of_scene(cls, scene: _loaded.LoadedScene, index: int) -> Object:
        made = object.__new__(cls)
        made._model = SceneModel(scene, index)
        made._native = made._model._native
        made._changes = {}
        return made

    def _change(self, key: str, value: Any) -> None:
        """Changes one value; the object that a renderer may have meanwhile stays as it is."""
        if key == "name":
            if not isinstance(value, str) or value != value.strip() or re.search(r"[\x00-\x1f\x7f-\x9f]", value):
                raise invalid("name", f"{value!r}"[:200], "a text of one line, without blanks at its ends")
            changed = self._native.with_name(value)
        elif key == "blur":
            changed = self._native.with_blur(_arrays.flag(value, "blur"))
        elif key == "receive_shadows":
            changed = self._native.with_receive_shadows(_arrays.flag(value, "receive_shadows"))
        elif key == "shadow_catcher":
            changed = self._native.with_shadow_catcher(_arrays.flag(value, "shadow_catcher"))
        elif key == "cast_shadows":
            changed = self._native.with_cast_shadows(_arrays.flag(value, "cast_shadows"))
        elif key == "opacity":
            value = _arrays.number(value, "opacity")
            if not 0.0 <= value <= 1.0:
                raise invalid("opacity", value, "a number from 0 to 1")
            changed = self._native.with_opacity(value)
        elif key == "transform":
            value = _arrays.matrices(value, "transform")
            changed = self._native.with_transform(value[:1])
        elif key == "poses":
            if not isinstance(value, tuple) or len(value) != 2:
                raise invalid("poses", f"a {type(value).__name__}", "a pair (times, matrices)")
            matrices = _arrays.matrices(value[1], "poses")
            value = (_arrays.times(value[0], "times of poses", len(matrices)), matrices)
            changed = self._native.with_poses(*value)
        elif key == "velocity":
            value = _arrays.three(value, "velocity")
            changed = self._native.with_velocity(value)
        else:
            numbers = _arrays.real(value, "material")
            if numbers.shape != (4,) or not np.isfinite(numbers).all() or (numbers < 0).any():
                raise invalid("material", f"{value!r}"[:200], "four numbers of at least 0")
            value = tuple(float(number) for number in numbers)
            changed = self._native.with_material(value)
        self._native = changed
        self._changes[key] = value

    @property
    def name(self) -> str:
        """Its name in the scene."""
        return self._native.name

    @name.setter
    def name(self, value: str) -> None:
        self._change("name", value)

    @property
    def blur(self) -> bool:
        """False: it is posed at the frame number, and is not blurred."""
        return self._native.blur

    @blur.setter
    def blur(self, value: bool) -> None:
        self._change("blur", value)

    @property
    def receive_shadows(self) -> bool:
        """False: no shadows fall on its surfels or Gaussians."""
        return self._native.receive_shadows

    @receive_shadows.setter
    def receive_shadows(self, value: bool) -> None:
        self._change("receive_shadows", value)

    @property
    def shadow_catcher(self) -> bool:
        """True: nothing of it shows but the shadows on it, as black with alpha."""
        return self._native.shadow_catcher

    @shadow_catcher.setter
    def shadow_catcher(self, value: bool) -> None:
        self._change("shadow_catcher", value)

    @property
    def cast_shadows(self) -> bool:
        """False: it keeps no light from anything."""
        return self._native.cast_shadows

    @cast_shadows.setter
    def cast_shadows(self, value: bool) -> None:
        self._change("cast_shadows", value)

    @property
    def opacity(self) -> float:
        """A factor on all opacities, 0 to 1."""
        return self._native.opacity

    @opacity.setter
    def opacity(self, value: float) -> None:
        self._change("opacity", value)

    @property
    def transform(self) -> npt.NDArray[np.float64]:
        """Model to world before any motion, (4, 4)."""
        return self._native.transform()

    @transform.setter
    def transform(self, value: npt.ArrayLike) -> None:
        self._change("transform", value)

    @property
    def poses(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
        """The poses that it was given: times (T,) in frames, and matrices (T, 4, 4). Motions of files are not here."""
        return self._native.poses()

    @poses.setter
    def poses(self, value: tuple[npt.ArrayLike, npt.ArrayLike]) -> None:
        self._change("poses", value)

    @property
    def model(self) -> Model:
        """What it is made of."""
        return self._model

    def pose_at(self, frame: float, *, rate: float = 24.0) -> npt.NDArray[np.float64]:
        """Model to world at a time (frames), (4, 4), in a scene of `rate` frames per second."""
        return self._native.pose_at(_arrays.number(rate, "rate"), _arrays.number(frame, "frame"))

    def __repr__(self) -> str:
        return f"<splatblur.Object {self.name!r}: {len(self._model)} {self._model.kind}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self._model, self._changes)


def _rebuilt(model: Model, changes: dict[str, Any]) -> Object:
    made = object.__new__(Object)
    made._model, made._changes = model, {}
    if _native.is_forked():
        return made
    made._native = model._native
    for key, value in changes.items():
        made._change(key, value)
    return made
