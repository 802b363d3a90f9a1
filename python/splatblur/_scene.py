"""Scenes: objects, a camera, a shutter, lights; from code or from a file."""

from __future__ import annotations

import collections
import errno
import itertools
import math
import operator
import os
import re
from os import PathLike, fspath
from typing import Any, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from . import _arrays, _native
from ._camera import Camera, Environment, Light, Shutter
from ._errors import Fixed, invalid
from ._loaded import LoadedScene
from ._objects import Model, Object, tell

_RATE = 24.0
_MOST_FRAME = 1_000_000_000


class Scene(Fixed):
    """All that is rendered. Attributes may be changed at any time; a frame that is being rendered stays as it is.

    Attributes:
        objects: The objects. `scene["name"]` finds one.
        camera: The camera, or `None`: one that sees all objects.
        shutter: The exposure.
        lights: The lights, or `None`: the environment, or one from the upper right front, and some ambient light.
        background: Linear colour where nothing is, (3,).
        transparent: Leave the background out, and keep alpha.
        environment: What surrounds the scene, or `None`.
        rate: Frames per second.
        name: The scene's name.

    Args:
        objects: Objects, models or paths of model files.
        camera: As above. The image has its size.
        shutter: As above. The default is open from a quarter of a frame before the frame number to a quarter after it.
        lights: As above.
        background: As above; one number is grey.
        transparent: As above.
        environment: As above, or a picture of all directions (see `Environment`).
        rate: As above. The default is that of a shutter in seconds, else 24.
        frames: First and last frame. The default is that of all poses.
        size: Width and height of the image, pixels, for a scene without a camera. The default is 1024 x 768.
        name: As above.

    Raises:
        InvalidValue: A value is out of its bounds.
    """

    _attributes = (
        "objects", "camera", "shutter", "lights", "background", "transparent", "environment", "rate", "name",
    )

    def __init__(
        self,
        objects: Iterable[Object | Model | str | PathLike[str]] | Object | Model,
        *,
        camera: Camera | None = None,
        shutter: Shutter | None = None,
        lights: Sequence[Light] | None = None,
        background: npt.ArrayLike = 0.0,
        transparent: bool = False,
        environment: Environment | str | PathLike[str] | npt.ArrayLike | None = None,
        rate: float | None = None,
        frames: tuple[int, int] | None = None,
        size: tuple[int, int] | None = None,
        name: str = "scene",
    ) -> None:
        if isinstance(objects, (str, PathLike)):
            raise invalid("objects", f"the path {fspath(objects)!r}", "a list of objects (splatblur.load reads a file)")
        given = [objects] if isinstance(objects, (Object, Model)) else list(objects)
        self._base: LoadedScene | None = None
        self._shutter_of_base: Shutter | None = None
        self._camera_of_base: Camera | None = None
        self.objects: list[Object] = [each if isinstance(each, Object) else Object(each) for each in given]
        self.camera = camera
        self.shutter = shutter or Shutter()
        self.lights: list[Light] | None = None if lights is None else list(lights)
        self.background: npt.ArrayLike = background
        self.transparent = transparent
        if environment is not None and not isinstance(environment, Environment):
            environment = Environment(environment)
        self.environment: Environment | None = environment
        self.rate = _RATE if rate is None and self.shutter.fps is None else (rate or self.shutter.fps)
        self._frames = None if frames is None else _frames(frames)
        self._size = None if size is None else _size(size)
        self.name = name
        self._resolve()

    @classmethod
    def _load(cls, path: str, size: tuple[int, int] | None, lenient: bool) -> Scene:
        base = LoadedScene(path, size, lenient)
        tell(base.native.notes)
        scene = object.__new__(cls)
        scene._take(base)
        return scene

    def _take(self, base: LoadedScene) -> None:
        native = base.native
        name, size, background, transparent, frames, rate, shutter, lights = native.values
        self._base = base
        self._shutter_of_base = self.shutter = Shutter(*shutter)  # type: ignore[arg-type]
        self._camera_of_base = self.camera = Camera._of(native.camera, size)
        self._frames, self._size = frames, size
        self.objects = [Object._of_scene(base, index) for index in range(len(native.objects))]
        self.lights = [Light(*light) for light in lights]  # type: ignore[arg-type]
        self.background, self.transparent, self.rate, self.name = background, transparent, rate, name
        environment = native.environment
        self.environment = None if environment is None else Environment._of(environment)
        # Light of an environment takes the place of lamps: another one does so, too, and without any there are lamps.
        if not self.lights and environment is not None and environment.settings[-1]:
            self.lights = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image, pixels: those of the camera, where there is one."""
        if self.camera is not None:
            return self.camera.width, self.camera.height
        return self._size or (1024, 768)

    @property
    def frames(self) -> range:
        """The frames of the sequence. A renderer takes any frame number."""
        if self._frames is None:
            return _range(self._resolve().values[4])
        return _range(self._frames)

    @frames.setter
    def frames(self, value: range | tuple[int, int]) -> None:
        self._frames = _frames((value[0], value[-1]))

    def __getitem__(self, key: str | int) -> Object:
        """An object by its name or number."""
        if not isinstance(key, str):
            return self.objects[operator.index(key)]
        names = self._names()
        if key not in names:
            raise KeyError(f"no object {key!r} (there are: {', '.join(names)})")
        return self.objects[names.index(key)]

    def __len__(self) -> int:
        return len(self.objects)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<splatblur.Scene {self.name!r}: {len(self.objects)} objects, {width} x {height}>"

    def _names(self) -> list[str]:
        """Names of the objects; those without one are numbered, by a number that is free."""
        names = [each.name for each in self.objects]
        given = {name for name in names if name}
        for number, name in enumerate(names):
            if name:
                continue
            free = (f"object{count}" for count in itertools.count(number + 1))
            names[number] = next(name for name in free if name not in given)
            given.add(names[number])
        if len(given) < len(names):
            twice = collections.Counter(names).most_common(1)[0][0]
            raise invalid("objects", f"two that are named {twice!r}", "a name of its own for each")
        return names

    def _resolve(self, camera: Camera | None = None) -> _native.Scene:
        """The scene as it is now, for a renderer. `camera` replaces its own."""
        camera = self.camera if camera is None else camera
        self._check_types()
        rate = _arrays.number(self.rate, "rate")
        if self.shutter.fps is not None and not math.isclose(self.shutter.fps, rate):
            found = f"in seconds at {self.shutter.fps:g} frames per second"
            raise invalid("shutter", found, f"fps={rate:g}, as scene.rate is (or set scene.rate = {self.shutter.fps:g})")
        natives = [each._native for each in self.objects]
        natives = [own if own.name else own.with_name(name) for own, name in zip(natives, self._names(), strict=True)]
        same_camera = camera is self._camera_of_base
        return _native.Scene.make(
            None if self._base is None else self._base.native,
            natives,
            {
                "name": self.name,
                "size": self.size if camera is None else (camera.width, camera.height),
                "background": _arrays.colour(self.background, "background"),
                "transparent": _arrays.flag(self.transparent, "transparent"),
                "frames": self._frames,
                "rate": rate,
                "shutter": None if self.shutter == self._shutter_of_base else self.shutter._values(),
                "lights": None if self.lights is None else [
                    (l.kind, l.place, l.colour, l.size, l.shadows) for l in self.lights
                ],
                "camera": None if camera is None or same_camera else camera._native,
                "environment": None if self.environment is None else self.environment._native,
            },
        )

    def _check_types(self) -> None:
        """Attributes may have been set to anything."""
        given: Any
        kind: Any
        for name, given, kind in (
            ("camera", self.camera, Camera), ("shutter", self.shutter, Shutter),
            ("environment", self.environment, Environment),
        ):
            if not isinstance(given, kind) and (given is not None or kind is Shutter):
                raise invalid(name, f"a {type(given).__name__}", f"a splatblur.{kind.__name__}")
        for name, given, kind in (("objects", self.objects, Object), ("lights", self.lights or (), Light)):
            if not isinstance(given, (list, tuple)) or not all(isinstance(each, kind) for each in given):
                raise invalid(name, f"{given!r}"[:200], f"a list of splatblur.{kind.__name__}")
        if not isinstance(self.name, str):
            raise invalid("name", f"{self.name!r}"[:200], "a text")

    def camera_to_world(self, frame: float) -> npt.NDArray[np.float64]:
        """Camera to world at a time (frames), (4, 4), OpenGL axes: x right, y up, the camera looks along -z."""
        return self._resolve().camera_to_world(_arrays.number(frame, "frame"))

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the scene as XML, for the program and for `load`.

        Models that were made in code are written beside it, as `<scene>.<object>.bin`, captures as `.ply`; an
        environment of pixels as `<scene>.environment.exr`. A file that is being written is finished before Ctrl-C ends
        the rest.

        Raises:
            InvalidValue: An object or the camera goes through poses, or the camera's axis is not in the middle, which a
                scene file cannot hold; or colours of a capture are linear, which its file cannot hold.
            OSError: A file cannot be written.
        """
        path = fspath(path)
        scene = self._resolve()
        for each, name in zip(self.objects, self._names(), strict=True):
            if each.poses is not None:
                raise invalid(f"poses of {name}", "given as arrays", "motion that a scene file can hold")
        camera = None if self.camera is self._camera_of_base or self.camera is None else self.camera._native
        if camera is not None and camera.poses() is not None:
            raise invalid("camera", "moving through poses given as arrays", "motion that a scene file can hold")
        if camera is not None and not camera.of_file and max(map(abs, camera.lens[2])) > 1e-12:
            raise invalid("K", "of an axis that is not in the middle of the image", "one that a scene file can hold")
        for own in scene.objects:
            _check_capture(own)
        stem = os.path.splitext(path)[0]
        written = []
        taken = {f"{stem}.environment.exr"}
        for own, name in zip(scene.objects, self._names(), strict=True):
            if not own.path and own.kind in ("surfels", "gaussians"):
                end = "bin" if own.kind == "surfels" else "ply"
                # A name may hold what no file name can.
                plain = re.sub(r"[^\w.-]", "_", name)
                files = (f"{stem}.{plain}{number or ''}.{end}" for number in itertools.count())
                file = next(file for file in files if file not in taken)
                taken.add(file)
                if own.kind == "surfels":
                    own.save(file)
                else:
                    _write_capture(own, file)
                own = own.with_path(file)
            written.append(own.with_antialias())
        environment = scene.environment
        if environment is not None and not environment.path:
            environment = environment.saved(f"{stem}.environment.exr")
        scene.of_saved(written, environment).save(path)

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        if self.camera is self._camera_of_base:
            state["camera"] = None
        state["_camera_of_base"] = None
        # First, so that objects that come from it find it read.
        return {"_base": state.pop("_base"), **state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._base is not None and not _native.is_forked():
            native = self._base.native
            self._camera_of_base = Camera._of(native.camera, native.values[1])
            self.camera = self.camera or self._camera_of_base


def _check_capture(own: _native.Object) -> None:
    columns = own.columns() if own.kind == "gaussians" and not own.path else None
    if columns is not None and columns["linear"]:
        raise invalid(f"capture {own.name}", "of linear colours", "sRGB-encoded ones, which PLY holds")


def _write_capture(own: _native.Object, path: str) -> None:
    from .io._ply import write_gaussians

    columns = own.columns()
    assert columns is not None
    write_gaussians(path, columns)


def _frames(value: tuple[int, int]) -> tuple[int, int]:
    if len(value) != 2:
        raise invalid("frames", f"{value!r}"[:200], "first and last frame")
    first, last = (_arrays.count(number, "frames", -_MOST_FRAME, _MOST_FRAME) for number in value)
    if last < first:
        raise invalid("frames", f"{value!r}", "a last frame that is not before the first")
    return first, last


def _range(frames: tuple[int, int]) -> range:
    return range(frames[0], frames[1] + 1)


def _size(value: tuple[int, int]) -> tuple[int, int]:
    if len(value) != 2:
        raise invalid("size", f"{value!r}"[:200], "width and height")
    width, height = (_arrays.count(number, "size", 1, 65_535) for number in value)
    return width, height


def load(path: str | PathLike[str], *, size: tuple[int, int] | None = None, lenient: bool = False) -> Scene:
    """Reads a scene file with all that it names, or a model file, which becomes a scene of its own.

    Args:
        path: A scene file (XML), or any model file.
        size: Width and height of the image, pixels, in place of the scene's. It belongs here: a camera that the file
            leaves out is found for an image of this shape, and meshes are sampled as finely as it needs.
        lenient: Makes warnings of unknown elements and attributes, where they are errors by default.

    Raises:
        FileNotFoundError: There is no such file.
        SceneError: The scene, or a file that it names, is not valid; with file, line, what was found and expected.
        ModelError: The model is not valid.
    """
    path = fspath(path)
    if not os.path.exists(path):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
    return Scene._load(path, None if size is None else _size(size), _arrays.flag(lenient, "lenient"))


def save(scene: Scene, path: str | PathLike[str]) -> None:
    """Writes a scene as XML; see `Scene.save`."""
    scene.save(path)


