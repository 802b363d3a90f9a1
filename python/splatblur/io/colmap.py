"""COLMAP: poses and points of a reconstruction, text or binary."""

from __future__ import annotations

import os
import struct
from os import PathLike, fspath
from typing import Any, Iterator

import numpy as np
import numpy.typing as npt

from .._frame import srgb_to_linear
from .._objects import Points
from ._views import Views, refused, sorted_views

# Models of COLMAP (src/colmap/sensor/models.h): number, name, parameters that are focal lengths, and all of them.
_MODELS = {
    0: ("SIMPLE_PINHOLE", 1, 3), 1: ("PINHOLE", 2, 4), 2: ("SIMPLE_RADIAL", 1, 4), 3: ("RADIAL", 1, 5),
    4: ("OPENCV", 2, 8), 5: ("OPENCV_FISHEYE", 2, 8), 6: ("FULL_OPENCV", 2, 12), 7: ("FOV", 2, 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 1, 4), 9: ("RADIAL_FISHEYE", 1, 5), 10: ("THIN_PRISM_FISHEYE", 2, 12),
}
_BY_NAME = {name: (focal, count) for name, focal, count in _MODELS.values()}
_Lens = tuple[np.ndarray[Any, Any], tuple[int, int], bool]


def views(folder: str | PathLike[str]) -> Views:
    """The photographs of a reconstruction.

    Args:
        folder: The folder with `cameras` and `images`, `.bin` or `.txt`; `sparse/0` below it is found, too. Distortion
            is left out: undistort the pictures, or mind `Views.distorted`.

    Raises:
        ModelError: A file is missing, cut off or not valid.
    """
    place = _find(fspath(folder))
    lenses = dict(_cameras(place))
    rows = []
    for name, camera, quaternion, translation in _images(place):
        if camera not in lenses:
            raise refused(place, f"camera {camera} of {name}", "a camera that is in the list of cameras")
        K, size, distorted = lenses[camera]
        rows.append((name, _camera_to_world(quaternion, translation), K, size, distorted))
    return sorted_views(rows)


def points(folder: str | PathLike[str], **options: Any) -> Points:
    """The sparse points of a reconstruction.

    Args:
        folder: As in `views`.
        options: As of `splatblur.Points`, beside positions and colours.

    Raises:
        ModelError: A file is missing, cut off or not valid.
    """
    place = _find(fspath(folder))
    positions, codes = _points(place)
    return Points(positions, colours=srgb_to_linear(codes / 255.0), **options)


def _find(folder: str) -> str:
    for place in (folder, os.path.join(folder, "sparse", "0"), os.path.join(folder, "colmap", "sparse", "0")):
        if any(os.path.exists(os.path.join(place, f"images.{end}")) for end in ("bin", "txt")):
            return place
    raise refused(folder, "no images.bin and no images.txt", "the folder of a COLMAP reconstruction")


def _file(place: str, name: str) -> tuple[str, bool]:
    binary = os.path.join(place, f"{name}.bin")
    if os.path.exists(binary):
        return binary, True
    text = os.path.join(place, f"{name}.txt")
    if os.path.exists(text):
        return text, False
    raise refused(place, f"no {name}.bin and no {name}.txt", "one of them")


def _camera_to_world(quaternion: Any, translation: Any) -> npt.NDArray[np.float64]:
    """World to camera (OpenCV axes, w first) turned into camera to world (OpenGL axes)."""
    w, x, y, z = np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    made = np.eye(4)
    made[:3, :3] = turn.T @ np.diag([1.0, -1.0, -1.0])
    made[:3, 3] = -turn.T @ np.asarray(translation)
    return made


def _lens(file: str, model: str, width: int, height: int, values: Any) -> _Lens:
    focal, count = _BY_NAME.get(model, (0, 0))
    if count == 0 or len(values) != count:
        raise refused(file, f"camera model {model} with {len(values)} parameters", f"one of {', '.join(_BY_NAME)}")
    fx, fy = values[0], values[focal - 1]
    cx, cy = values[focal : focal + 2]
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return K, (int(width), int(height)), bool(np.any(values[focal + 2 :]))


def _lines(file: str) -> Iterator[tuple[int, str]]:
    with open(file, encoding="utf-8", errors="replace") as text:
        for number, line in enumerate(text, 1):
            if not line.startswith("#"):
                yield number, line.strip()


class _Bytes:
    """A binary file, read from its beginning."""

    def __init__(self, file: str) -> None:
        self.file = file
        with open(file, "rb") as opened:
            self.data = opened.read()
        self.at = 0

    def take(self, form: str) -> tuple[Any, ...]:
        size = struct.calcsize(form)
        if self.at + size > len(self.data):
            raise refused(self.file, "its end", f"{size} more bytes at byte {self.at}")
        self.at += size
        return struct.unpack_from(form, self.data, self.at - size)

    def skip(self, count: int) -> None:
        if count > len(self.data) - self.at:
            raise refused(self.file, "its end", f"{count} more bytes at byte {self.at}")
        self.at += count

    def name(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise refused(self.file, "its end", f"the end of the name at byte {self.at}")
        text = self.data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return text


def _cameras(place: str) -> Iterator[tuple[int, _Lens]]:
    file, binary = _file(place, "cameras")
    if binary:
        data = _Bytes(file)
        for _ in range(data.take("<Q")[0]):
            number, kind, width, height = data.take("<iiQQ")
            if kind not in _MODELS:
                raise refused(file, f"camera model {kind}", f"a number from 0 to {len(_MODELS) - 1}")
            name, _, count = _MODELS[kind]
            yield number, _lens(file, name, width, height, data.take(f"<{count}d"))
        return
    for line, text in _lines(file):
        if text:
            words = text.split()
            try:
                yield int(words[0]), _lens(file, words[1], int(words[2]), int(words[3]), [float(w) for w in words[4:]])
            except (ValueError, IndexError) as why:
                raise refused(file, repr(text[:80]), "ID MODEL WIDTH HEIGHT PARAMETERS", line) from why


def _images(place: str) -> Iterator[tuple[str, int, Any, Any]]:
    file, binary = _file(place, "images")
    if binary:
        data = _Bytes(file)
        for _ in range(data.take("<Q")[0]):
            _, *pose, camera = data.take("<i7di")
            name = data.name()
            data.skip(24 * data.take("<Q")[0])
            yield _sound(file, name, camera, pose)
        return
    lines = _lines(file)
    for line, text in lines:
        if not text:
            continue
        words = text.split(maxsplit=9)
        try:
            pose = [float(word) for word in words[1:8]]
            yield _sound(file, words[9], int(words[8]), pose)
        except (ValueError, IndexError) as why:
            raise refused(file, repr(text[:80]), "ID QW QX QY QZ TX TY TZ CAMERA NAME", line) from why
        # The line of the points, which may be empty.
        next(lines, None)


def _sound(file: str, name: str, camera: int, pose: Any) -> tuple[str, int, Any, Any]:
    if not (np.isfinite(pose).all() and np.linalg.norm(pose[:4]) > 0.0):
        raise refused(file, f"the pose {pose} of {name}", "finite numbers, and a quaternion with a direction")
    return name, camera, pose[:4], pose[4:]


def _points(place: str) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    file, binary = _file(place, "points3D")
    rows: list[tuple[Any, ...]] = []
    if binary:
        data = _Bytes(file)
        for _ in range(data.take("<Q")[0]):
            _, x, y, z, r, g, b, _ = data.take("<QdddBBBd")
            data.skip(8 * data.take("<Q")[0])
            rows.append((x, y, z, r, g, b))
    else:
        for line, text in _lines(file):
            if text:
                try:
                    rows.append(tuple(float(word) for word in text.split(maxsplit=7)[1:7]))
                except ValueError as why:
                    raise refused(file, repr(text[:80]), "ID X Y Z R G B ERROR", line) from why
    table = np.array(rows, np.float64).reshape(-1, 6)
    return table[:, :3], np.clip(table[:, 3:], 0, 255)
