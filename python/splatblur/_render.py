"""The renderer."""

from __future__ import annotations

import os
from typing import Any, Callable, Iterable, Iterator, Sequence, overload

from . import _arrays, _native
from ._camera import Camera
from ._errors import invalid
from ._frame import Frame
from ._objects import tell
from ._scene import Scene

Aovs = str | Sequence[str]


def _choices(
    mode: str = "auto",
    aovs: Aovs = (),
    seed: int = 1,
    filter: str = "box",
    prefilter: str = "auto",
    shading: str = "phong",
    detail: str = "auto",
    two_sided: bool = False,
    epsilon: float | None = None,
    shadows: bool = True,
    smooth: bool = False,
    **unknown: Any,
) -> dict[str, Any]:
    """The choices of a picture, as `_native` takes them; checked."""
    if unknown:
        known = "seed, filter, prefilter, shading, detail, two_sided, epsilon, shadows, smooth"
        raise TypeError(f"unexpected keyword argument {sorted(unknown)[0]!r} (there are: {known})")
    texts = {"mode": mode, "filter": filter, "prefilter": prefilter, "shading": shading, "detail": detail}
    for name, text in texts.items():
        if not isinstance(text, str):
            raise invalid(name, f"a {type(text).__name__}", "a text")
    choices = texts | {
        "aovs": _arrays.names(aovs, "aovs"),
        "seed": _arrays.count(seed, "seed", 0, 2**64 - 1),
        "two_sided": _arrays.flag(two_sided, "two_sided"),
        "epsilon": None if epsilon is None else _arrays.number(epsilon, "epsilon"),
        "shadows": _arrays.flag(shadows, "shadows"),
        "smooth": _arrays.flag(smooth, "smooth"),
    }
    _native.check_choices(choices)
    return choices


def _bar(progress: bool, total: float, unit: str) -> Any:
    """A bar of tqdm, where it is installed and wanted."""
    if not progress:
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm(total=total, unit=unit)


class Frames:
    """Frames of a scene, each rendered when it is asked for. It has a length, and is gone through once."""

    def __init__(self, numbers: Sequence[float], make: Callable[[float], Frame], progress: bool) -> None:
        self._numbers = numbers
        self._make = make
        self._next = 0
        self._bar = _bar(progress, len(numbers), "frame")

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[Frame]:
        return self

    def __next__(self) -> Frame:
        if self._next >= len(self._numbers):
            if self._bar is not None:
                self._bar.close()
            raise StopIteration
        frame = self._make(self._numbers[self._next])
        self._next += 1
        if self._bar is not None:
            self._bar.update()
        return frame


class Renderer:
    """A device that renders. Make one, and use it for many frames.

    It works without the interpreter's lock, so other Python threads run meanwhile. Ctrl-C ends a frame that is rendered
    in the main thread. Two threads may use one renderer, one after the other. After `fork` it raises `ForkError`: its
    threads are not in the child. Start workers by spawn.

    Args:
        device: `auto` (a hardware GPU if there is one, else the CPU), `cpu`, `gpu`, or a part of the name of a GPU.
        threads: Threads of the CPU, 1 to 1024. The default is all cores. Pictures do not depend on it.
        memory: Bytes that a frame and its models may take together. The default is half of what there is, and at least
            1 GiB; more than there is is not taken. Pictures do not depend on it.

    Raises:
        RenderError: There is no such device.
    """

    def __init__(self, device: str = "auto", *, threads: int | None = None, memory: int | None = None) -> None:
        if not isinstance(device, str):
            raise invalid("device", f"{device!r}"[:200], "'auto', 'cpu', 'gpu' or a part of a name")
        threads = None if threads is None else _arrays.count(threads, "threads", 1, 1024)
        memory = None if memory is None else _arrays.count(memory, "memory", 1, 2**63 - 1)
        if "XDG_RUNTIME_DIR" not in os.environ:
            # Else a layer of Mesa prints an error where nothing is wrong (src/cli/selection.rs).
            os.environ.setdefault("NODEVICE_SELECT", "1")
        self._native = _native.Renderer(device, threads, memory)

    @property
    def backend(self) -> str:
        """`cpu` or `gpu`."""
        return self._native.backend

    def __repr__(self) -> str:
        return f"<splatblur.Renderer: {self._native.description}>"

    @overload
    def render(
        self, scene: Scene, frame: float = 0, mode: str = "auto", aovs: Aovs = (), *, cameras: None = None, **look: Any
    ) -> Frame: ...

    @overload
    def render(
        self, scene: Scene, frame: float = 0, mode: str = "auto", aovs: Aovs = (), *, cameras: Sequence[Camera],
        **look: Any,
    ) -> list[Frame]: ...

    def render(
        self,
        scene: Scene,
        frame: float = 0,
        mode: str = "auto",
        aovs: Aovs = (),
        *,
        cameras: Sequence[Camera] | None = None,
        **look: Any,
    ) -> Frame | list[Frame]:
        """Renders a frame.

        Args:
            scene: The scene.
            frame: The frame number; any finite number.
            mode: The mode in its one text form, as on the command line: `auto:good`, `supersample:32`,
                `bucket:8x4`, `volumetric:3`, `still`; docs/modes.md says which one when.
            aovs: Layers beside the colours: `alpha`, `depth`, `normal`, `velocity`, `samples`, `error` (of mode auto),
                `lod_error`, `object`.
            cameras: Renders the frame once for each, and returns a list.
            look: `seed` (int), `filter` (`box`, `point`, `gaussian:0.5`), `prefilter` (`auto`, `ewa`, `approx`,
                `none`), `shading` (`phong`, `gouraud`), `detail` (`auto`, `draft`, `good`, `final`, `full`),
                `two_sided` (bool), `epsilon` (float), `shadows` (bool), `smooth` (bool: a filter along the
                motion).

        Returns:
            A `Frame`, or a list of them for `cameras`.

        Raises:
            InvalidValue: A choice or a value of the scene is out of its bounds.
            RenderError: The frame does not fit into the memory, or the mode cannot show the scene.
            KeyboardInterrupt: Ctrl-C was pressed.
        """
        choices = _choices(mode, aovs, **look)
        number = _arrays.frame(frame, "frame")
        if cameras is None:
            return self._frame(_native_of(scene), number, choices)
        return [self._frame(_native_of(scene, camera), number, choices) for camera in cameras]

    def _frame(self, scene: _native.Scene, number: float, choices: dict[str, Any]) -> Frame:
        frame = Frame._of(self._native.render(scene, number, choices), number)
        left_out = frame.stats["left_out"]
        if left_out:
            note = f"{left_out} pixels, over all instants, have too many layers of see-through surfels; those behind " \
                   "are left out"
            tell([note])
        return frame

    def frames(
        self,
        scene: Scene,
        numbers: Iterable[float] | None = None,
        mode: str = "auto",
        aovs: Aovs = (),
        *,
        progress: bool = False,
        **look: Any,
    ) -> Frames:
        """Renders frames of a scene, each when it is asked for.

        Args:
            scene: The scene, as it is now: later changes do not count.
            numbers: Frame numbers. The default is all frames of the scene.
            mode: As in `render`.
            aovs: As in `render`.
            progress: Shows a bar, where tqdm is installed.
            look: As in `render`.

        Returns:
            An iterator of `Frame`, with a length.
        """
        choices = _choices(mode, aovs, **look)
        native = _native_of(scene)
        given = scene.frames if numbers is None else numbers
        listed = [_arrays.frame(number, "numbers") for number in given]
        return Frames(listed, lambda number: self._frame(native, number, choices), progress)

    def reference(
        self,
        scene: Scene,
        frame: float = 0,
        samples: int = 256,
        aovs: Aovs = (),
        *,
        error: float | None = None,
        progress: bool = False,
        **look: Any,
    ) -> Frame:
        """Traces the reference of a frame: what pictures of all modes are judged by. It shares no pass with them.

        Args:
            scene: The scene.
            frame: The frame number.
            samples: Samples of a pixel, a multiple of 16.
            aovs: `alpha`, `depth`, `normal`, `velocity`, `samples`.
            error: Stops at this mean standard error, linear light; `samples` are the most then.
            progress: Shows a bar, where tqdm is installed.
            look: `seed`, `filter`, `shading`, `two_sided`, `epsilon`, `shadows`, as in `render`.

        Returns:
            A `Frame` with its `standard_error`.

        Raises:
            InvalidValue: A value is out of its bounds.
            RenderError: The number of samples is not a multiple of 16, or too large.
            KeyboardInterrupt: Ctrl-C was pressed.
        """
        choices = _choices(aovs=aovs, **look)
        samples = _arrays.count(samples, "samples", 1, 2**62)
        error = None if error is None else _arrays.number(error, "error")
        if error is not None and not error > 0.0:
            raise invalid("error", error, "a standard error above 0")
        number = _arrays.frame(frame, "frame")
        bar = _bar(progress, 1.0, "round")

        def tell(share: float) -> None:
            bar.n = round(share, 3)
            bar.refresh()

        told = None if bar is None else tell
        made = self._native.reference(_native_of(scene), number, choices, samples, error, told)
        if bar is not None:
            bar.n = 1.0
            bar.close()
        return Frame._of(made, number)


def _native_of(scene: Scene, camera: Camera | None = None) -> _native.Scene:
    if not isinstance(scene, Scene):
        raise invalid("scene", f"a {type(scene).__name__}", "a Scene")
    if camera is not None and not isinstance(camera, Camera):
        raise invalid("cameras", f"a {type(camera).__name__}", "Cameras")
    return scene._resolve(camera)


_SHARED: dict[tuple[int, str], Renderer] = {}


def shared(device: str = "auto") -> Renderer:
    """The renderer of this process that `render` uses."""
    key = (os.getpid(), device)
    if key not in _SHARED:
        _SHARED[key] = Renderer(device)
    return _SHARED[key]


@overload
def render(
    scene: Scene, frame: float = 0, mode: str = "auto", aovs: Aovs = (), *, cameras: None = None, device: str = "auto",
    **look: Any,
) -> Frame: ...


@overload
def render(
    scene: Scene, frame: float = 0, mode: str = "auto", aovs: Aovs = (), *, cameras: Sequence[Camera],
    device: str = "auto", **look: Any,
) -> list[Frame]: ...


def render(
    scene: Scene,
    frame: float = 0,
    mode: str = "auto",
    aovs: Aovs = (),
    *,
    cameras: Sequence[Camera] | None = None,
    device: str = "auto",
    **look: Any,
) -> Frame | list[Frame]:
    """Renders a frame on a renderer that all calls share; see `Renderer.render`."""
    return shared(device).render(scene, frame, mode, aovs, cameras=cameras, **look)
