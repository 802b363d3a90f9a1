"""The camera and its shutter, lights and surroundings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _arrays, _native
from ._errors import invalid
from ._native import Camera as NativeCamera

_MOST_SIZE = 65_535
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


class Camera:
    """A pinhole camera. The keyword of its place is the convention:

    * `eye=`, `at=`, `up=`: points of the world.
    * `viewmat=`: world to camera, OpenCV axes (x right, y down, z forward), as gsplat and COLMAP have it.
    * `c2w=`: camera to world, OpenGL axes (x right, y up, the camera looks along -z), as nerfstudio and Blender have
      it.

    Matrices of shape (T, 4, 4) with `times` move the camera. Without any place the camera sees all objects.

    Args:
        width: Width of the image, pixels.
        height: Height of the image, pixels.
        K: Intrinsics, (3, 3), pixels; the middle of the first pixel is (0.5, 0.5). Pixels are square.
        fovy: Vertical field of view, degrees, in place of `K`. The default is 40.
        eye: Where the camera is, (3,), scene units.
        at: Where it looks, (3,).
        up: Its up direction, (3,).
        viewmat: World to camera, OpenCV axes, (4, 4) or (T, 4, 4).
        c2w: Camera to world, OpenGL axes, (4, 4) or (T, 4, 4).
        times: Frame numbers of the matrices, (T,), rising. Between two poses the camera moves at constant speed and
            turns the shorter way; before the first and after the last it rests.
        near: Nearest visible depth, scene units, above 0. The default is 0.01.

    Raises:
        InvalidValue: A matrix has a wrong shape, is not finite, mirrors, or is no rotation with a translation (one scale
            of all axes changes nothing); times do not rise; or pixels are not square.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        K: npt.ArrayLike | None = None,
        fovy: float | None = None,
        eye: npt.ArrayLike | None = None,
        at: npt.ArrayLike | None = None,
        up: npt.ArrayLike | None = None,
        viewmat: npt.ArrayLike | None = None,
        c2w: npt.ArrayLike | None = None,
        times: npt.ArrayLike | None = None,
        near: float | None = None,
    ) -> None:
        self._width = _arrays.count(width, "width", 1, _MOST_SIZE)
        self._height = _arrays.count(height, "height", 1, _MOST_SIZE)
        looks = any(value is not None for value in (eye, at, up))
        if sum([looks, viewmat is not None, c2w is not None]) > 1:
            raise TypeError("give the place of a camera once: by eye, at and up, by viewmat, or by c2w")
        depth = 0.01 if near is None else _arrays.number(near, "near")
        if not 0.0 < depth < math.inf:
            raise invalid("near", depth, "a depth above 0")
        lens = self._lens(K, fovy, depth)
        if looks:
            if eye is None or at is None:
                raise TypeError("a camera needs `eye` and `at`")
            if times is not None:
                raise TypeError("`times` go with viewmat or c2w of the shape (T, 4, 4)")
            self._native: NativeCamera | None = _native.Camera.look(
                _arrays.three(eye, "eye"),
                _arrays.three(at, "at"),
                (0.0, 1.0, 0.0) if up is None else _arrays.three(up, "up"),
                lens,
            )
        elif viewmat is not None or c2w is not None:
            self._native = _posed(viewmat, c2w, times, lens)
        else:
            if any(value is not None for value in (times, K, fovy, near)):
                raise TypeError(
                    "a camera without a place is found by itself, with a field of view of 40 degrees: give it a place, "
                    "or neither `times`, `K`, `fovy` nor `near`"
                )
            self._native = None

    @classmethod
    def _of(cls, native: _native.Camera, size: tuple[int, int]) -> Camera:
        camera = object.__new__(cls)
        camera._native = native
        camera._width, camera._height = size
        return camera

    def _lens(self, K: npt.ArrayLike | None, fovy: float | None, near: float) -> _native._Lens:
        if K is None:
            degrees = 40.0 if fovy is None else _arrays.number(fovy, "fovy")
            if not 0.0 < degrees < 180.0:
                raise invalid("fovy", degrees, "degrees, more than 0 and less than 180")
            return math.radians(degrees), near, (0.0, 0.0)
        if fovy is not None:
            raise TypeError("give a camera `K` or `fovy`, not both")
        k = _arrays.real(K, "K").astype(np.float64)
        if k.shape != (3, 3) or not np.isfinite(k).all():
            raise invalid("K", f"of shape {k.shape}, or not finite", "the shape (3, 3), finite")
        fx, fy, cx, cy = (float(k[i, j]) for i, j in ((0, 0), (1, 1), (0, 2), (1, 2)))
        if not (fx > 0.0 and fy > 0.0 and abs(fx / fy - 1.0) <= 1e-2):
            raise invalid("K", f"focal lengths {fx} and {fy}", "square pixels: both alike within 1 %, above 0")
        if not np.allclose([k[0, 1], k[1, 0], k[2, 0], k[2, 1], k[2, 2]], [0, 0, 0, 0, 1], atol=1e-6 * fy):
            raise invalid("K", "skewed, or no matrix of intrinsics", "[[f, 0, cx], [0, f, cy], [0, 0, 1]]")
        fovy_radians = 2.0 * math.atan(0.5 * self._height / fy)
        return fovy_radians, near, (cx / self._width - 0.5, cy / self._height - 0.5)

    @property
    def width(self) -> int:
        """Width of the image, pixels."""
        return self._width

    @property
    def height(self) -> int:
        """Height of the image, pixels."""
        return self._height

    @property
    def fovy(self) -> float:
        """Vertical field of view, degrees."""
        return 40.0 if self._native is None else math.degrees(self._native.lens[0])

    @property
    def K(self) -> npt.NDArray[np.float64]:
        """Intrinsics, (3, 3), pixels."""
        fovy, _, (right, down) = (math.radians(40.0), 0.0, (0.0, 0.0)) if self._native is None else self._native.lens
        f = 0.5 * self._height / math.tan(0.5 * fovy)
        return np.array([[f, 0, (0.5 + right) * self._width], [0, f, (0.5 + down) * self._height], [0, 0, 1.0]])

    def __repr__(self) -> str:
        moving = self._native is not None and (self._native.of_file or self._native.poses() is not None)
        return f"<splatblur.Camera {self._width} x {self._height}, fovy {self.fovy:.4g}{', moving' if moving else ''}>"

    def __reduce__(self) -> tuple[Any, ...]:
        size = (self._width, self._height)
        if self._native is None:
            return _found, size
        if self._native.of_file:
            raise TypeError("a camera that a file moves cannot be pickled alone: pickle its scene")
        return _again, (size, self._native.lens, self._native.look_at, self._native.poses())


def _found(width: int, height: int) -> Camera:
    return Camera(width, height)


def _again(size: tuple[int, int], lens: _native._Lens, look_at: Any, poses: Any) -> Camera:
    if poses is None:
        eye, at, up = look_at
        native = _native.Camera.look(eye, at, up, lens)
    else:
        times, matrices = poses
        native = _native.Camera.moving(times, matrices, lens)
    return Camera._of(native, size)


def _posed(
    viewmat: npt.ArrayLike | None, c2w: npt.ArrayLike | None, times: npt.ArrayLike | None, lens: _native._Lens
) -> _native.Camera:
    if viewmat is not None:
        matrices = _arrays.ready(np.linalg.inv(_arrays.placements(viewmat, "viewmat")) @ _FLIP)
    else:
        matrices = _arrays.placements(c2w, "c2w")
    if times is not None:
        return _native.Camera.moving(_arrays.times(times, "times", len(matrices)), matrices, lens)
    if len(matrices) > 1:
        raise TypeError(f"{len(matrices)} matrices need `times`, the frame number of each")
    # Refused where it is singular or sheared, as poses are.
    _native.Camera.moving(np.zeros(1), matrices, lens)
    matrix = matrices[0]
    back = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    eye = matrix[:3, 3]
    return _native.Camera.look(
        _arrays.three(eye, "eye"), _arrays.three(eye - back, "at"), _arrays.three(matrix[:3, 1], "up"), lens
    )


@dataclass(frozen=True)
class Shutter:
    """The exposure, in frames around the frame number.

    Attributes:
        open: When it opens, frames from the frame number.
        close: When it closes, frames from the frame number; `open` itself is an instant.
        weight: Weight of times: `box`, `tent`, `ramp`, `exponential`, `one-minus-exponential` or `gaussian`, with
            parameters, as in `gaussian:centre=0.5,width=0.2`.
        readout: Frames from the exposure of the first row to that of the last one; 0: all at once.
        direction: Where the read-out goes: `down`, `up`, `right` or `left`.
        anchor: The row that is exposed at the shutter's own times: `middle` or `first`.
        fps: Frames per second, where the shutter was given in seconds; the scene has this rate then.
    """

    open: float = -0.25
    close: float = 0.25
    weight: str = "box"
    readout: float = 0.0
    direction: Literal["down", "up", "right", "left"] = "down"
    anchor: Literal["middle", "first"] = "middle"
    fps: float | None = None

    def __post_init__(self) -> None:
        _native.check_shutter(self._values())

    @classmethod
    def seconds(
        cls,
        exposure: float,
        *,
        fps: float,
        readout: float = 0.0,
        weight: str = "box",
        direction: Literal["down", "up", "right", "left"] = "down",
        anchor: Literal["middle", "first"] = "middle",
    ) -> Shutter:
        """A shutter in seconds, open around the time of each frame.

        Args:
            exposure: How long it is open, seconds.
            fps: Frames per second; the scene has this rate.
            readout: Seconds from the exposure of the first row to that of the last one.
            weight: As in `Shutter`.
            direction: As in `Shutter`.
            anchor: As in `Shutter`.

        Raises:
            InvalidValue: A number is negative or not finite.
        """
        exposure, fps = _arrays.number(exposure, "exposure"), _arrays.number(fps, "fps")
        readout = _arrays.number(readout, "readout")
        if not 0.0 < fps < math.inf:
            raise invalid("fps", fps, "frames per second, above 0")
        if not 0.0 <= exposure < math.inf or not 0.0 <= readout < math.inf:
            raise invalid("exposure and readout", f"{exposure} and {readout}", "seconds, at least 0")
        half = 0.5 * exposure * fps
        return cls(-half, half, weight, readout * fps, direction, anchor, fps)

    def _values(self) -> _native._ShutterValues:
        for name, text in {"weight": self.weight, "direction": self.direction, "anchor": self.anchor}.items():
            if not isinstance(text, str):
                raise invalid(name, f"a {type(text).__name__}", "a text")
        return (
            _arrays.number(self.open, "open"),
            _arrays.number(self.close, "close"),
            self.weight,
            _arrays.number(self.readout, "readout"),
            self.direction,
            self.anchor,
        )


@dataclass(frozen=True)
class Light:
    """A light. Make one by `Light.directional`, `Light.point` or `Light.ambient`.

    Attributes:
        kind: `directional`, `point` or `ambient`.
        place: The direction in which the light travels, or the position of the point.
        colour: Radiance, linear Rec.709; of a point that at distance 1.
        size: Angle under which a directional light is seen, degrees; radius of the ball of a point. It softens shadows.
        shadows: Do there are shadows in it?
    """

    kind: Literal["directional", "point", "ambient"]
    place: tuple[float, float, float]
    colour: tuple[float, float, float]
    size: float = 0.0
    shadows: bool = True

    @classmethod
    def directional(
        cls,
        direction: npt.ArrayLike,
        colour: npt.ArrayLike | None = None,
        *,
        angle: float = 0.5,
        shadows: bool = True,
        color: npt.ArrayLike | None = None,
    ) -> Light:
        """Light that travels along `direction`, (3,), from infinitely far. One number is a grey colour."""
        way = np.array(_arrays.three(direction, "direction"))
        length = float(np.linalg.norm(way))
        if not length > 0.0:
            raise invalid("direction", "0", "a direction")
        x, y, z = (float(part) for part in way / length)
        size = _arrays.number(angle, "angle")
        return cls("directional", (x, y, z), _colour(colour, color), size, _arrays.flag(shadows, "shadows"))

    @classmethod
    def point(
        cls,
        position: npt.ArrayLike,
        colour: npt.ArrayLike | None = None,
        *,
        radius: float = 0.0,
        shadows: bool = True,
        color: npt.ArrayLike | None = None,
    ) -> Light:
        """A light at `position`, (3,), that falls off with the square of the distance."""
        place, size = _arrays.three(position, "position"), _arrays.number(radius, "radius")
        return cls("point", place, _colour(colour, color), size, _arrays.flag(shadows, "shadows"))

    @classmethod
    def ambient(cls, colour: npt.ArrayLike | None = None, *, color: npt.ArrayLike | None = None) -> Light:
        """Light from everywhere."""
        return cls("ambient", (0.0, 0.0, 0.0), _colour(colour, color), shadows=False)

    @property
    def color(self) -> tuple[float, float, float]:
        """The same as `colour`."""
        return self.colour


def _colour(colour: npt.ArrayLike | None, color: npt.ArrayLike | None) -> tuple[float, float, float]:
    """The colour of a light, white where none is given."""
    given = _arrays.one_of(colour, color, "colour", "color")
    return _arrays.colour(1.0 if given is None else given, "colour")


class Environment:
    """What surrounds a scene, infinitely far: surfaces may mirror it, it may be the background, and it may light them.

    Args:
        picture: A file, PNG, EXR or Radiance HDR, or pixels (H, 2 H, 3), linear: all directions by latitude and
            longitude.
        rotation: Turns it about +y, degrees.
        intensity: A factor on its light.
        background: Shows it where no surface does.
        light: Lights the scene with it. The default is to do so where the scene has no lights of its own.
        shadows: Surfaces cast shadows in its light. Without them it is smooth.

    Raises:
        InvalidValue: The picture is not twice as wide as high, or has values below 0 or not finite.
        ImageError: The file cannot be read.
    """

    def __init__(
        self,
        picture: str | PathLike[str] | npt.ArrayLike,
        *,
        rotation: float = 0.0,
        intensity: float = 1.0,
        background: bool = True,
        light: bool | None = None,
        shadows: bool = True,
    ) -> None:
        numbers = _arrays.number(rotation, "rotation"), _arrays.number(intensity, "intensity")
        flags = _arrays.flag(background, "background"), _arrays.flag(shadows, "shadows")
        settings = (*numbers, *flags, None if light is None else _arrays.flag(light, "light"))
        if isinstance(picture, (str, PathLike)):
            self._native = _native.Environment.load(fspath(picture), *settings)
        else:
            pixels = _arrays.picture(picture, "environment")[..., :3]
            self._native = _native.Environment.of_pixels(_arrays.ready(pixels), *settings)

    @classmethod
    def _of(cls, native: _native.Environment) -> Environment:
        environment = object.__new__(cls)
        environment._native = native
        return environment

    def __reduce__(self) -> tuple[Any, ...]:
        path = self._native.path
        return _surroundings, (path or self._native.pixels(), *self._native.settings)


def _surroundings(
    picture: Any, rotation: float, intensity: float, background: bool, shadows: bool, light: bool | None
) -> Environment:
    return Environment(
        picture, rotation=rotation, intensity=intensity, background=background, light=light, shadows=shadows
    )
