"""Everything that a user hands over as an array goes through here, and is refused with a clear message."""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np
import numpy.typing as npt

from ._errors import invalid


def numpy_of(value: object, name: str) -> npt.NDArray[Any]:
    """A numpy array of anything that is one: arrays, tensors by `__dlpack__` or `__array__`, nested lists.

    Tensors are detached from their gradients, and copied to main memory where they are on a GPU.
    """
    if isinstance(value, np.ndarray):
        if isinstance(value, np.ma.MaskedArray):
            raise invalid(name, "a masked array", "an array without a mask, as value.filled(...) makes it")
        return np.asarray(value)
    tensor: Any = value
    for step in ("detach", "cpu"):
        method = getattr(tensor, step, None)
        if callable(method):
            tensor = method()
    try:
        if hasattr(tensor, "__dlpack__"):
            try:
                return np.asarray(np.from_dlpack(tensor))
            except (BufferError, RuntimeError, TypeError, ValueError):
                pass  # A type or a layout that numpy does not take; `__array__` may.
        return np.asarray(tensor)
    except Exception as why:
        raise invalid(name, f"a {type(value).__name__}", f"an array of numbers ({why})") from why


def real(value: object, name: str) -> npt.NDArray[Any]:
    """An array of real numbers, float32 or float64, in the machine's byte order; not copied where it is that."""
    array = numpy_of(value, name)
    if array.dtype.kind not in "fiub":
        raise invalid(name, f"of dtype {array.dtype}", "real numbers")
    single = array.dtype.kind == "f" and array.dtype.itemsize <= 4
    wanted = np.dtype(np.float32 if single else np.float64)
    if array.dtype == wanted and array.dtype.isnative:
        return array
    with np.errstate(over="ignore"):
        return array.astype(wanted)


def ready(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The array, C-contiguous and aligned; not copied where it is that."""
    return np.require(array, requirements=["C", "A"])


def column(value: object, name: str, rows: int | None, width: int | None) -> npt.NDArray[Any]:
    """A column of a model: (N,) or (N, width). One row stands for all, where the number of rows is known."""
    array = real(value, name)
    shape = "(N,)" if width is None else f"(N, {width})"
    if rows is not None:
        shape = shape.replace("N", str(rows))
        one = () if width is None else (width,)
        if array.shape in (one, (1, *one)):
            array = np.broadcast_to(array, (rows, *one))
    fits = array.ndim == (1 if width is None else 2) and (width is None or array.shape[1] == width)
    if not fits or (rows is not None and len(array) != rows):
        raise invalid(name, f"of shape {array.shape}", f"the shape {shape}")
    return ready(array)


def _light(value: object, name: str) -> npt.NDArray[Any]:
    """Linear light. Whole numbers are refused: they are codes, which somebody has to decode."""
    array = numpy_of(value, name)
    if array.dtype.kind in "iu" and array.size and array.max() > 1:
        found = f"of dtype {array.dtype} with values up to {array.max()}"
        raise invalid(name, found, "linear light, as splatblur.srgb_to_linear(values / 255) makes it")
    return array


def colours(value: object, name: str, rows: int) -> npt.NDArray[Any]:
    """A column of linear colours."""
    array = column(_light(value, name), name, rows, 3)
    if array.size and array.min() < 0.0:
        raise invalid(name, f"{array.min()} at its least", "linear light, at least 0")
    return array


def whole(value: object, name: str, rows: int) -> npt.NDArray[Any]:
    """A column of whole numbers."""
    array = numpy_of(value, name)
    if array.dtype.kind not in "iu" or array.shape != (rows,):
        raise invalid(name, f"of dtype {array.dtype} and shape {array.shape}", f"whole numbers of the shape ({rows},)")
    if array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise invalid(name, f"up to {array.max()}", f"numbers up to {np.iinfo(np.int64).max}")
    return ready(array.astype(np.int64, copy=False))


def matrices(value: object, name: str) -> npt.NDArray[Any]:
    """Transforms, (T, 4, 4) of float64; (4, 4) is one, and a missing last row is 0 0 0 1."""
    array = real(value, name).astype(np.float64, copy=False)
    if array.ndim == 2:
        array = array[None]
    if array.ndim == 3 and array.shape[1:] == (3, 4):
        last = np.broadcast_to(np.array([0.0, 0.0, 0.0, 1.0]), (len(array), 1, 4))
        array = np.concatenate([array, last], axis=1)
    if array.ndim != 3 or array.shape[1:] != (4, 4) or len(array) == 0:
        raise invalid(name, f"of shape {array.shape}", "the shape (4, 4) or (T, 4, 4)")
    if not np.isfinite(array).all():
        raise invalid(name, "not finite", "finite numbers")
    if not np.allclose(array[:, 3], [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=1e-6):
        found = " ".join(f"{number:g}" for number in array[np.abs(array[:, 3] - [0, 0, 0, 1]).max(axis=1).argmax(), 3])
        raise invalid(name, f"a matrix with the last row {found}", "0 0 0 1 in the last row")
    return ready(array)


def placements(value: object, name: str) -> npt.NDArray[Any]:
    """Matrices of cameras, (T, 4, 4): a rotation and a translation, and perhaps one scale of all axes, which changes
    no picture."""
    array = matrices(value, name)
    turns = array[:, :3, :3]
    scale = np.cbrt(np.linalg.det(turns))
    if (scale < 0.0).any():
        raise invalid(name, "a matrix that mirrors", "rotations and translations")
    if (scale < 1e-9).any():
        raise invalid(name, "a singular matrix", "rotations and translations")
    turns = turns / scale[:, None, None]
    off = float(np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max())
    if off > 1e-3:
        raise invalid(name, f"{off:.3g} away from a rotation", "rotations and translations, without a shear or scales")
    return array


def times(value: object, name: str, count: int) -> npt.NDArray[Any]:
    """Times of poses, frames: as many as poses, rising."""
    array = real(value, name).astype(np.float64, copy=False)
    if array.shape != (count,):
        raise invalid(name, f"of shape {array.shape}", f"the shape ({count},), one time for each pose")
    return ready(array)


def colour(value: object, name: str) -> tuple[float, float, float]:
    """Linear light, also beyond 1; one number is grey."""
    array = real(value, name)
    return three(np.repeat(array, 3) if array.shape == () else array, name)


def three(value: object, name: str) -> tuple[float, float, float]:
    """Three finite numbers."""
    array = real(value, name).astype(np.float64, copy=False)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise invalid(name, f"{value!r}"[:200], "three finite numbers")
    x, y, z = (float(number) for number in array)
    return x, y, z


def number(value: object, name: str) -> float:
    """A number; not a text or an array of several."""
    array = real(value, name)
    if array.shape != ():
        raise invalid(name, f"of shape {array.shape}", "one number")
    return float(array)


def flag(value: object, name: str) -> bool:
    """Yes or no; not a text or a number, which might mean anything."""
    if not isinstance(value, (bool, np.bool_)):
        raise invalid(name, f"{value!r}"[:200], "True or False")
    return bool(value)


def frame(value: object, name: str) -> float:
    """A frame number: finite, and not so large that a frame more is the same."""
    found = number(value, name)
    if not abs(found) <= 1e9:
        raise invalid(name, found, "a frame number from -1e9 to 1e9")
    return found


def count(value: object, name: str, least: int, most: int) -> int:
    """A whole number within bounds."""
    given = getattr(value, "__index__", None)
    found = given() if callable(given) and not isinstance(value, bool) else None
    if not isinstance(found, int) or not least <= found <= most:
        raise invalid(name, f"{value!r}"[:200], f"a whole number from {least} to {most}")
    return found


def picture(value: object, name: str) -> npt.NDArray[Any]:
    """Pixels (H, W, 4) of float32: linear, premultiplied. (H, W, 3) is opaque."""
    array = real(_light(value, name), name)
    if array.ndim != 3 or array.shape[2] not in (3, 4) or 0 in array.shape:
        raise invalid(name, f"of shape {array.shape}", "the shape (H, W, 3) or (H, W, 4)")
    with np.errstate(over="ignore"):
        array = array.astype(np.float32, copy=False)
    if array.shape[2] == 3:
        array = np.concatenate([array, np.ones((*array.shape[:2], 1), np.float32)], axis=2)
    return ready(array)


def one_of(value: Any, other: Any, name: str, other_name: str) -> Any:
    """The value of one of two spellings."""
    if value is not None and other is not None:
        raise TypeError(f"`{name}` and `{other_name}` are the same: give one of them")
    return other if value is None else value


def names(value: str | Sequence[str], name: str) -> list[str]:
    """Words: one, or several."""
    words = [value] if isinstance(value, str) else list(value)
    if not all(isinstance(word, str) for word in words):
        raise invalid(name, f"{value!r}"[:200], "words")
    return words
