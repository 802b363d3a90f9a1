"""Pictures: what a renderer hands out."""

from __future__ import annotations

import os
from os import PathLike, fspath
from typing import Any, Sequence

import numpy as np
import numpy.typing as npt

from . import _arrays, _native
from ._errors import invalid

Metrics = str | Sequence[str]


class Frame:
    """A picture with its layers, as numpy arrays. Row 0 is at the top.

    Colours and layers of one channel are the renderer's own memory, which is not copied; normals and velocities are
    copied once, because the renderer has their channels apart. A frame keeps its arrays, and they keep themselves:
    they may outlive it. `numpy.asarray(frame)` and `torch.from_dlpack(frame)` are `rgba`.

    Attributes:
        number: The frame number.
        rgba: Linear Rec.709 light, premultiplied by alpha, (H, W, 4) of float32. Alpha is 1 where a background is.
        stats: Counts and times: `seconds`, `backend`, `samples`, `stated_error` (what mode auto states, root mean
            square of display values; of a reference the mean standard error), `auto`, `pass_seconds` and others.
        object_names: Names of the objects that the layer `object` counts, the first of which is 1.
    """

    def __init__(self, rgba: npt.ArrayLike, *, number: float = 0.0, layers: dict[str, Any] | None = None) -> None:
        """A frame of arrays: `rgba` (H, W, 4), or (H, W, 3) which is opaque, linear and premultiplied."""
        self.rgba: npt.NDArray[np.float32] = _arrays.picture(rgba, "rgba")
        self.number = number
        self.stats: dict[str, Any] = {}
        self.object_names: list[str] = []
        self._layers: dict[str, npt.NDArray[np.float32]] = dict(layers or {})
        self._transparent = bool((self.rgba[..., 3] < 1.0).any())
        self._origin: _native.Origin | None = None
        self._address: int | None = None

    @classmethod
    def _of(cls, made: dict[str, Any], number: float) -> Frame:
        frame = object.__new__(cls)
        frame.number = number
        frame.rgba = made.pop("rgba")
        frame.stats = made.pop("stats", {})
        frame.object_names = made.pop("object_names", [])
        frame._origin = made.pop("origin", None)
        frame._address = made.pop("address", None)
        opaque = made.pop("transparent", None)
        frame._transparent = bool((frame.rgba[..., 3] < 1.0).any()) if opaque is None else opaque
        frame._layers = made
        return frame

    @property
    def width(self) -> int:
        """Width, pixels."""
        return int(self.rgba.shape[1])

    @property
    def height(self) -> int:
        """Height, pixels."""
        return int(self.rgba.shape[0])

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers that were rendered beside the colours."""
        return tuple(self._layers)

    def _layer(self, name: str) -> npt.NDArray[np.float32]:
        if name not in self._layers:
            raise AttributeError(f"the frame has no layer {name!r}: render it with aovs=[{name!r}]")
        return self._layers[name]

    @property
    def alpha(self) -> npt.NDArray[np.float32]:
        """Share of the exposure in which surfaces cover the pixel, 0 to 1, (H, W)."""
        return self._layer("alpha")

    @property
    def depth(self) -> npt.NDArray[np.float32]:
        """Distance along the camera's axis, scene units, (H, W); infinite where nothing is seen."""
        return self._layer("depth")

    @property
    def normal(self) -> npt.NDArray[np.float32]:
        """Mean shading normal, world space, (H, W, 3); 0 where nothing is seen."""
        return self._layer("normal")

    @property
    def velocity(self) -> npt.NDArray[np.float32]:
        """Mean motion on the image, pixels a shutter, x right and y down, (H, W, 2); 0 where nothing is seen."""
        return self._layer("velocity")

    @property
    def samples(self) -> npt.NDArray[np.float32]:
        """Time samples of the pixel, (H, W)."""
        return self._layer("samples")

    @property
    def object(self) -> npt.NDArray[np.float32]:
        """Number of the object with the largest share of the pixel, (H, W), from 1; 0 where nothing is seen."""
        return self._layer("object")

    @property
    def error(self) -> npt.NDArray[np.float32]:
        """Error of r, g, b and coverage, (H, W, 4): of a reference its standard error in linear light, of mode auto its
        estimate for the block around, root mean square of display values."""
        return self._layer("error")

    @property
    def standard_error(self) -> npt.NDArray[np.float32]:
        """Standard error of r, g, b and coverage of a reference, (H, W, 4), linear light."""
        return self._layer("error")

    @property
    def lod_error(self) -> npt.NDArray[np.float32]:
        """Error by detail that is left out, for the block around, (H, W), root mean square of display values."""
        return self._layer("lod_error")

    @property
    def srgb8(self) -> npt.NDArray[np.uint8]:
        """The codes of a PNG file: R G B A with straight alpha, (H, W, 4)."""
        return _native.srgb8(_arrays.picture(self.rgba, "rgba"))

    def save(self, path: str | PathLike[str], *, bits: int | None = None, compression: str = "zip") -> None:
        """Writes the picture; the file appears whole or not at all.

        A frame of a scene file has the bytes that `splatblur render` writes: its header says what made it. PNG holds
        the colours alone, EXR all layers.

        Args:
            path: `.png` (sRGB, straight alpha) or `.exr` (linear, premultiplied).
            bits: PNG 8 or 16, EXR 16 or 32. The default is 8 and 32.
            compression: Of EXR: `none`, `rle`, `zips`, `zip` or `piz`.

        Raises:
            ImageError: A value is not finite.
            InvalidValue: The format does not exist, or an array has another shape than the renderer gave it.
            OSError: The file cannot be written, or the scene's files have changed since they were loaded.
        """
        path = os.fsdecode(path)
        layers = {} if path.lower().endswith(".png") else self._layers
        layers = {name: _arrays.ready(np.asarray(layer, np.float32)) for name, layer in layers.items()}
        rgba = _arrays.picture(self.rgba, "rgba")
        _native.save(path, rgba, layers, self.object_names, self._transparent, self._origin, bits, compression)

    def _repr_png_(self) -> bytes:
        return _native.png(_arrays.picture(self.rgba, "rgba"))

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy:
            return np.array(self.rgba, dtype=dtype)
        array = self.rgba if dtype is None else self.rgba.astype(dtype, copy=False)
        if copy is False and array is not self.rgba:
            raise ValueError(f"a frame is float32, and becomes {np.dtype(dtype)} by a copy alone")
        return array

    def __dlpack__(self, **options: Any) -> Any:
        return self.rgba.__dlpack__(**options)

    def __dlpack_device__(self) -> tuple[int, int]:
        device: tuple[int, int] = self.rgba.__dlpack_device__()
        return device

    def __getstate__(self) -> dict[str, Any]:
        # The scene stays behind, so headers of files that are written elsewhere do not name it.
        return {**self.__dict__, "_origin": None, "_address": None}

    def __repr__(self) -> str:
        layers = f" with {', '.join(self._layers)}" if self._layers else ""
        return f"<splatblur.Frame {self.number:g}: {self.width} x {self.height}{layers}>"


def read(path: str | PathLike[str]) -> Frame:
    """Reads a picture, PNG or EXR, into linear, premultiplied light.

    Raises:
        ImageError: The file cannot be read, or is no such picture.
    """
    return Frame._of(_native.read(fspath(path)), 0.0)


Picture = Frame | str | PathLike[str] | npt.ArrayLike


def _pixels(value: Picture, name: str) -> npt.NDArray[np.float32]:
    if isinstance(value, (str, PathLike)):
        value = read(value)
    return _arrays.picture(value.rgba if isinstance(value, Frame) else value, name)


def compare(a: Picture, b: Picture, metrics: Metrics = ("flip", "psnr")) -> dict[str, float]:
    """How far picture `a` is from the reference `b`.

    Args:
        a: A frame, a file, or linear pixels (H, W, 3 or 4).
        b: The same.
        metrics: Names: `mse`, `rmse`, `relmse`, `mae`, `bias`, `worst`, `gamma-rmse`, `psnr`, `ssim`, `flip`,
            `alpha-rmse`, `alpha-mae`, `alpha-bias`, `alpha-worst`, `non-finite`. docs/compare.md has the formulas.

    Returns:
        The value of each metric, by its name.

    Raises:
        InvalidValue: The sizes differ, or there is no such metric.
    """
    names = _arrays.names(metrics, "metrics")
    values = _native.compare(_pixels(a, "a"), _pixels(b, "b"), names)
    return dict(zip(names, values, strict=True))


def srgb_to_linear(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Decodes sRGB values, 0 to 1, to linear light, 0 to 1. Codes of 8 bits are divided by 255 before."""
    coded = _arrays.real(values, "values").astype(np.float64)
    if coded.size and (np.nanmax(coded) > 1.0 or np.nanmin(coded) < 0.0):
        raise invalid("values", f"from {np.nanmin(coded)} to {np.nanmax(coded)}", "values from 0 to 1")
    light: npt.NDArray[np.float64] = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return light


def linear_to_srgb(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Encodes linear light as sRGB values; what is below 0 or above 1 is clipped."""
    light = np.clip(_arrays.real(values, "values").astype(np.float64), 0.0, 1.0)
    coded: npt.NDArray[np.float64] = np.where(
        light <= 0.0031308, light * 12.92, 1.055 * np.power(light, 1 / 2.4) - 0.055
    )
    return coded


