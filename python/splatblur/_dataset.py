"""Paired truth, as a data set that is rendered while it is read."""

from __future__ import annotations

from typing import Any, Callable, Iterable, Literal, Mapping

import numpy as np
import numpy.typing as npt

from . import _arrays, _native
from ._errors import invalid
from ._frame import linear_to_srgb
from ._render import Renderer, _choices, _native_of
from ._scene import Scene


class Dataset:
    """Blurred pictures with the truth about them, each frame rendered when it is asked for.

    `torch.utils.data.DataLoader` takes it, also with workers: start them by spawn
    (`multiprocessing_context="spawn"`). torch is not needed by this class. It holds what `splatblur dataset` writes
    (docs/dataset.md); colours have three channels.

    A frame is a dict of arrays:

    * `blurred` (3, H, W), `sharp` (N, 3, H, W): colours; with `channels="last"` the channels come last.
    * `sharp_times` (N,) frames, `sharp_weights` (N,): the sum of the sharp pictures with these weights tends to the
      blurred one, in linear light. With n pictures the sum is a trapezoid rule.
    * `flow_open_close`, `flow_middle_close` (2, H, W): motion in pixels, x right and y down, of what the first instant
      shows; `..._valid` (H, W) says where there is any, `..._seen` where the surface is seen at the second instant.
    * `depth`, `alpha` (H, W): of the middle of the shutter; depth is infinite where nothing is seen.
    * `error` (4, H, W): error of the blurred picture before noise, with mode auto and with `reference`.
    * `c2w_open`, `c2w_middle`, `c2w_close` (4, 4): camera to world, OpenGL axes; `K` (3, 3): intrinsics.
    * `frame`: the number; `stated_error`: what mode auto states, or the mean standard error; NaN where none is.

    Args:
        scene: A scene, or a function that makes the scene of a frame number, as for a camera that shakes. Workers need
            one that can be pickled: a function of a module.
        frames: Frame numbers. The default is all frames of the scene.
        sharp: Sharp pictures of a frame, 1 to 1024, at even times from where the shutter opens to where it closes. One
            is that of the middle.
        noise: Noise of blurred pictures: `dict(shot=electrons_of_white, read=deviation)`, or the text of the program.
        response: How light becomes the values of pictures: `srgb`, `gamma:G` or `linear`, clipped to 0 to 1 as a file
            is. `None`: linear light, not clipped.
        bits: 8 or 16: pictures are codes, as those of a PNG file. `None`: float32.
        reference: Samples of a pixel for ray-traced pictures; 0: the mode makes them.
        mode: The mode, as in `Renderer.render`. The default is auto without a lattice, which a network would learn.
        flow: Make the flow. Volumes have none.
        channels: Where the channels are: `first` or `last`.
        seed: Seed of the noise and of all that is random.
        device: As in `Renderer`.
        threads: As in `Renderer`. With several workers, give each its share of the cores.

    Raises:
        InvalidValue: A choice is out of its bounds.
    """

    def __init__(
        self,
        scene: Scene | Callable[[float], Scene],
        frames: Iterable[float] | None = None,
        *,
        sharp: int = 3,
        noise: Mapping[str, float] | str | None = None,
        response: str | None = None,
        bits: Literal[8, 16] | None = None,
        reference: int = 0,
        mode: str = "auto+interleave=none",
        flow: bool = True,
        channels: Literal["first", "last"] = "first",
        seed: int = 1,
        device: str = "auto",
        threads: int | None = None,
    ) -> None:
        if not isinstance(scene, Scene) and not callable(scene):
            raise invalid("scene", f"a {type(scene).__name__}", "a Scene, or a function that makes one")
        if frames is None and not isinstance(scene, Scene):
            raise TypeError("a function that makes scenes needs `frames`")
        given = scene.frames if frames is None and isinstance(scene, Scene) else frames
        self.scene = scene
        self.frames = [_arrays.frame(number, "frames") for number in ([] if given is None else given)]
        self._recipe = {
            "sharp": _arrays.count(sharp, "sharp", 1, 1024),
            "noise": _noise(noise),
            "flow": _arrays.flag(flow, "flow"),
            "reference": _arrays.count(reference, "reference", 0, 2**62),
        }
        if reference % 16:
            raise invalid("reference", reference, "a multiple of 16")
        _native.check_recipe(self._recipe)
        self._choices = _choices(mode, seed=seed)
        if bits not in (None, 8, 16):
            raise invalid("bits", bits, "8, 16 or None")
        if channels not in ("first", "last"):
            raise invalid("channels", f"{channels!r}"[:200], "'first' or 'last'")
        self._gamma = _gamma(response if response is not None or bits is None else "srgb")
        self._bits = bits
        self._channels = channels
        if not isinstance(device, str):
            raise invalid("device", f"{device!r}"[:200], "'auto', 'cpu', 'gpu' or a part of a name")
        self._device = device
        self._threads = None if threads is None else _arrays.count(threads, "threads", 1, 1024)
        self._renderer: Renderer | None = None

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Renders the frame of this index; not of a slice, whose frames may not fit into memory."""
        if not hasattr(index, "__index__"):
            raise TypeError(f"the index of a frame is a whole number, not a {type(index).__name__}")
        number = self.frames[index]
        scene = self.scene if isinstance(self.scene, Scene) else self.scene(number)
        native = _native_of(scene)
        if self._renderer is None:
            self._renderer = Renderer(self._device, threads=self._threads)
        made = self._renderer._native.pair(native, number, self._choices, self._recipe)
        made["blurred"] = self._colours(made["blurred"])
        made["sharp"] = np.stack([self._colours(picture) for picture in made["sharp"]])
        for name in ("flow_open_close", "flow_middle_close"):
            flow = made.pop(name, None)
            if flow is not None:
                made[name] = self._moved(flow[..., :2])
                made[f"{name}_valid"] = flow[..., 2] > 0.5
                made[f"{name}_seen"] = flow[..., 3] > 0.5
        if "error" in made:
            made["error"] = self._moved(made["error"])
        (fovy, _, (right, down)), (width, height) = native.camera.lens, native.values[1]
        f = 0.5 * height / np.tan(0.5 * fovy)
        made["K"] = np.array([[f, 0.0, (0.5 + right) * width], [0.0, f, (0.5 + down) * height], [0.0, 0.0, 1.0]])
        made["frame"] = number
        stated = made["stated_error"]
        made["stated_error"] = float("nan") if stated is None else stated
        return made

    def _moved(self, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The channels where they are wanted."""
        return np.ascontiguousarray(np.moveaxis(array, -1, 0) if self._channels == "first" else array)

    def _colours(self, rgba: npt.NDArray[np.float32]) -> npt.NDArray[Any]:
        values: npt.NDArray[Any] = rgba[..., :3]
        if self._gamma is not None:
            light = values.astype(np.float64)
            values = linear_to_srgb(light) if self._gamma == 0.0 else np.clip(light, 0.0, 1.0) ** (1.0 / self._gamma)
        if self._bits is not None:
            kind = np.uint8 if self._bits == 8 else np.uint16
            values = np.floor(values * (2**self._bits - 1) + 0.5).astype(kind)
        else:
            values = values.astype(np.float32, copy=False)
        return self._moved(values)

    def __iter__(self) -> Any:
        return (self[index] for index in range(len(self)))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}


def _noise(noise: Mapping[str, float] | str | None) -> str:
    if noise is None or noise == {}:
        return "none"
    if isinstance(noise, str):
        return noise
    if not isinstance(noise, Mapping):
        raise invalid("noise", f"a {type(noise).__name__}", "dict(shot=..., read=...)")
    return ",".join(f"{name}={_arrays.number(value, 'noise')!r}" for name, value in noise.items())


def _gamma(response: str | None) -> float | None:
    """The gamma of a response; 0 for sRGB, which has none, and `None` for light as it is."""
    if response is None:
        return None
    fixed = {"srgb": 0.0, "linear": 1.0}
    if response in fixed:
        return fixed[response]
    text = response if isinstance(response, str) else ""
    try:
        gamma = float(text.removeprefix("gamma:")) if text.startswith("gamma:") else 0.0
    except ValueError:
        gamma = 0.0
    if not 0.1 <= gamma <= 10.0:
        raise invalid("response", f"{response!r}"[:200], "srgb, linear or gamma:G with G from 0.1 to 10")
    return gamma
