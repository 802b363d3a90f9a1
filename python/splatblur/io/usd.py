"""USD: points, instancers, Gaussian splats and cameras of a stage. It needs usd-core."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any

import numpy as np
import numpy.typing as npt

from .._camera import Camera, Shutter
from .._objects import Gaussians, Model, Object, Points, tell
from .._scene import Scene
from ._views import refused

# Places of an instance that moves by velocities, from a frame before the time to a frame after it.
_STEPS = 9


def load(
    path: str | PathLike[str],
    *,
    time: float | None = None,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    linear: bool = False,
    **options: Any,
) -> Scene:
    """The scene of a stage at a time: its `Points`, point instancers of them, Gaussian splats, and a camera.

    Motion is what USD says: points move by their velocities and accelerations, instances by theirs, and prims by
    the samples of their transforms. `widths` are diameters. Axes stay as they are: a stage whose +z is up needs a
    camera of its own. Meshes are left out with a warning.

    Args:
        path: A `.usd`, `.usda`, `.usdc` or `.usdz` file.
        time: The frame (time code) whose points are taken. The default is the stage's first.
        camera: Path of a camera in the stage. The default is the first one that there is.
        size: Width and height of the image, pixels. The default is 1024 wide, in the shape of the camera's aperture.
        linear: Colours of splats are linear; the default is sRGB-encoded ones, as captures are trained.
        options: As of `Scene`, in place of what the stage says.

    Returns:
        A scene, with the stage's frames, rate, camera and shutter.

    Raises:
        ModelError: The file is no stage, or has nothing that is shown.
        ImportError: usd-core is missing.
    """
    from pxr import Tf, Usd, UsdGeom

    name = fspath(path)
    try:
        stage = Usd.Stage.Open(name)
    except Tf.ErrorException as why:
        said = str(why).strip().splitlines() or ["it cannot be opened"]
        raise refused(name, "no stage", f"a USD file ({said[0]})") from why
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    at = float(start if time is None else time)
    objects: list[Object] = []
    cameras = []
    for prim in stage.Traverse():
        if _below_instancer(prim) or UsdGeom.Imageable(prim).ComputeVisibility(at) == "invisible":
            continue
        if prim.IsA(UsdGeom.Camera):
            cameras.append(prim)
        elif prim.IsA(UsdGeom.PointInstancer):
            objects += _instances(name, prim, at, linear)
        elif prim.IsA(UsdGeom.Mesh):
            tell([f"{name}: mesh {prim.GetPath()} is left out; write it to a model file, and load that"])
        else:
            model = _model(prim, at, linear)
            if model is not None:
                objects.append(_placed(prim, model, at, (start, end)))
    if not objects:
        raise refused(name, "nothing that is shown", "Points, a PointInstancer or a ParticleField3DGaussianSplat")
    chosen = [prim for prim in cameras if camera is None or str(prim.GetPath()) == camera]
    if camera is not None and not chosen:
        raise refused(name, f"no camera {camera}", f"one of {[str(prim.GetPath()) for prim in cameras]}")
    given: dict[str, Any] = {"rate": stage.GetTimeCodesPerSecond()}
    if stage.HasAuthoredTimeCodeRange():
        given["frames"] = (round(start), round(max(start, end)))
    if chosen:
        given["camera"], shutter = _camera(UsdGeom.Camera(chosen[0]), at, size, (start, end))
        if shutter is not None:
            given["shutter"] = shutter
    elif size is not None:
        given["size"] = size
    return Scene(objects, **{**given, **options})


def _below_instancer(prim: Any) -> bool:
    from pxr import UsdGeom

    above = prim.GetParent()
    while above and not above.IsPseudoRoot():
        if above.IsA(UsdGeom.PointInstancer):
            return True
        above = above.GetParent()
    return False


def _array(attribute: Any, at: float) -> npt.NDArray[Any] | None:
    """The value of an attribute; `None` where it has none or no entries."""
    value = attribute.Get(at) if attribute else None
    array = None if value is None else np.array(value)
    return None if array is None or array.size == 0 else array


def _float_or_half(prim: Any, name: str, at: float) -> npt.NDArray[Any] | None:
    """The float attribute, else its twin of half precision."""
    value = _array(prim.GetAttribute(name), at)
    return _array(prim.GetAttribute(f"{name}h"), at) if value is None else value


def _model(prim: Any, at: float, linear: bool) -> Model | None:
    from pxr import UsdGeom

    if prim.IsA(UsdGeom.Points):
        return _points(UsdGeom.Points(prim), at)
    if prim.GetTypeName() == "ParticleField3DGaussianSplat":
        return _splats(prim, at, linear)
    return None


def _points(points: Any, at: float) -> Model | None:
    from pxr import UsdGeom

    # Between samples, points are where their velocities take them from the sample before.
    computed = points.ComputePointsAtTime(at, at)
    positions = None if computed is None or len(computed) == 0 else np.array(computed)
    if positions is None:
        return None
    rows = len(positions)
    widths = _array(points.GetWidthsAttr(), at)
    columns: dict[str, Any] = {
        "normals": _array(points.GetNormalsAttr(), at),
        "velocities": _array(points.GetVelocitiesAttr(), at),
        "accelerations": _array(points.GetAccelerationsAttr(), at),
        "ids": _array(points.GetIdsAttr(), at),
        "radii": None if widths is None else 0.5 * widths,
    }
    primvars = UsdGeom.PrimvarsAPI(points.GetPrim())
    for key, name in (("colours", "displayColor"), ("opacities", "displayOpacity")):
        primvar = primvars.GetPrimvar(name)
        value = primvar.ComputeFlattened(at) if primvar else None
        columns[key] = None if value is None or len(value) == 0 else np.array(value)
    fitting: dict[str, Any] = {}
    for key, value in columns.items():
        if value is not None:
            # One entry stands for all points.
            fitting[key] = np.broadcast_to(value, (rows, *value.shape[1:])) if len(value) == 1 else value
    return Points(positions, **fitting)


def _splats(prim: Any, at: float, linear: bool) -> Model | None:
    means = _float_or_half(prim, "positions", at)
    if means is None:
        return None
    rows = len(means)
    quats = prim.GetAttribute("orientations").Get(at) or prim.GetAttribute("orientationsh").Get(at)
    turns = [[q.GetReal(), *q.GetImaginary()] for q in quats] if quats else [[1.0, 0.0, 0.0, 0.0]] * rows
    scales = _float_or_half(prim, "scales", at)
    opacities = _float_or_half(prim, "opacities", at)
    sh = _float_or_half(prim, "radiance:sphericalHarmonicsCoefficients", at)
    filled = {
        "scales": np.ones((rows, 3)) if scales is None else scales,
        "opacities": np.ones(rows) if opacities is None else opacities,
    }
    colours: dict[str, Any] = {}
    if sh is None:
        shown = _array(prim.GetAttribute("primvars:displayColor"), at)
        colours["colours"] = np.full((rows, 3), 0.5) if shown is None else np.broadcast_to(shown, (rows, 3))
    else:
        each = max(1, len(sh) // rows)
        colours["sh"] = np.asarray(sh, np.float32).reshape(-1, each, 3)
    return Gaussians(means, turns, filled["scales"], filled["opacities"], linear=linear, **colours)


def _times_of(prim: Any, frames: tuple[float, float]) -> list[float]:
    """The frames at which a prim has to be posed: all of the stage, where it or a prim above it moves."""
    from pxr import UsdGeom

    samples: set[float] = set()
    above = prim
    while above and not above.IsPseudoRoot():
        xform = UsdGeom.Xformable(above)
        if xform:
            samples.update(xform.GetTimeSamples())
        above = above.GetParent()
    if len(samples) < 2:
        return sorted(samples)
    first, last = min(samples | {frames[0]}), max(samples | {frames[1]})
    # Curves between samples are linear in each operation, which is no line for products of them: every frame, too.
    return sorted(samples | {float(frame) for frame in np.arange(np.ceil(first), last + 1)[:100_000]})


def _world(prim: Any, at: float) -> npt.NDArray[np.float64]:
    """From the prim to the world. USD has row vectors."""
    from pxr import UsdGeom

    matrix: npt.NDArray[np.float64] = np.array(UsdGeom.Imageable(prim).ComputeLocalToWorldTransform(at)).T
    return matrix


def _placed(prim: Any, model: Model, at: float, frames: tuple[float, float]) -> Object:
    times = _times_of(prim, frames)
    name = str(prim.GetPath())
    if len(times) < 2:
        return Object(model, name=name, transform=_world(prim, times[0] if times else at))
    return Object(model, name=name, poses=(times, np.stack([_world(prim, each) for each in times])))


def _instances(file: str, prim: Any, at: float, linear: bool) -> list[Object]:
    """An object for each instance, which moves by the velocities of the instancer."""
    from pxr import UsdGeom

    instancer = UsdGeom.PointInstancer(prim)
    stage = prim.GetStage()
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    models = [_model(stage.GetPrimAtPath(target), at, linear) for target in targets]
    indices = _array(instancer.GetProtoIndicesAttr(), at)
    if indices is None or not any(model is not None for model in models):
        raise refused(file, f"no instances of points in {prim.GetPath()}", "prototypes that are Points or splats")
    velocities = _array(instancer.GetVelocitiesAttr(), at)
    spins = _array(instancer.GetAngularVelocitiesAttr(), at)
    moving = velocities is not None or spins is not None
    times = np.linspace(at - 1.0, at + 1.0, _STEPS) if moving else np.array([at])
    masked = instancer.IncludeProtoXform, instancer.ApplyMask
    made = [np.array(instancer.ComputeInstanceTransformsAtTime(float(each), at, *masked)) for each in times]
    kept = instancer.ComputeMaskAtTime(at)
    shown = indices if not kept else indices[np.array(kept)]
    parents = [_world(prim, float(each)) for each in times]
    objects = []
    for number, index in enumerate(shown):
        model = models[index] if 0 <= index < len(models) else None
        if model is None:
            continue
        poses = np.stack([parent @ each[number].T for parent, each in zip(parents, made, strict=True)])
        name = f"{prim.GetPath()}[{number}]"
        if moving:
            objects.append(Object(model, name=name, poses=(times, poses)))
        else:
            objects.append(Object(model, name=name, transform=poses[0]))
    return objects


def _camera(
    camera: Any, at: float, size: tuple[int, int] | None, frames: tuple[float, float]
) -> tuple[Camera, Shutter | None]:
    prim = camera.GetPrim()
    wide, high = (float(camera.GetHorizontalApertureAttr().Get(at)), float(camera.GetVerticalApertureAttr().Get(at)))
    width, height = size or (1024, max(1, round(1024 * high / wide)))
    # The aperture of the image's height decides; pixels are square.
    focal = float(camera.GetFocalLengthAttr().Get(at)) / high * height
    right = float(camera.GetHorizontalApertureOffsetAttr().Get(at)) / wide
    up = float(camera.GetVerticalApertureOffsetAttr().Get(at)) / high
    K = [[focal, 0.0, (0.5 - right) * width], [0.0, focal, (0.5 + up) * height], [0.0, 0.0, 1.0]]
    near = max(float(camera.GetClippingRangeAttr().Get(at)[0]), 1e-6)
    times = _times_of(prim, frames)
    options: dict[str, Any] = {"c2w": _world(prim, times[0] if times else at)}
    if len(times) > 1:
        options = {"c2w": np.stack([_world(prim, each) for each in times]), "times": times}
    opens, closes = camera.GetShutterOpenAttr().Get(at), camera.GetShutterCloseAttr().Get(at)
    shutter = Shutter(float(opens), float(closes)) if closes > opens else None
    return Camera(width, height, K=K, near=near, **options), shutter
