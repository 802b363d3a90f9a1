"""Whatever is handed over: an exception that says what is wrong, or a picture; never a crash.

`SPLATBLUR_EXAMPLES` is the number of examples of each property; python/run takes 10,000 in all.
"""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest
from conftest import SCENES, front
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hn

import splatblur as sb

EXAMPLES = int(os.environ.get("SPLATBLUR_EXAMPLES", "150"))
LIMITS = settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), print_blob=True, derandomize=True
)
REFUSALS = (sb.SplatblurError, TypeError, KeyError, OSError)

DTYPES = st.sampled_from([
    np.float64, np.float32, np.float16, np.longdouble, np.int8, np.uint8, np.int64, np.uint64, np.bool_, np.complex64,
    ">f8", ">f4", "U3", "S2", "M8[s]", object,
])
NUMBERS = st.one_of(
    st.floats(width=64, allow_nan=True, allow_infinity=True),
    st.floats(-5, 5),
    st.sampled_from([0.0, -0.0, 1e-320, 1e18, -1e18, 1e30, 1e308, np.nan, np.inf, 1.0]),
)


@st.composite
def arrays(draw, shape=None):
    """An array of any dtype, shape, order, stride and sign of strides; read-only or not."""
    rows = draw(st.integers(0, 6)) if shape is None else shape[0]
    shapes = [shape, (rows, 3), (rows,), (3,), (), (rows, 2), (rows, 4), (rows, 3, 1), (0, 3)]
    shape = draw(st.sampled_from([each for each in shapes if each is not None]))
    dtype = draw(DTYPES)
    if np.dtype(dtype).kind == "f" and draw(st.booleans()):
        values = draw(hn.arrays(np.float64, shape, elements=NUMBERS))
        with np.errstate(over="ignore"):
            array = values.astype(dtype)
    elif dtype is object:
        array = np.full(shape, draw(st.sampled_from([None, "x", 1.5, {}])), object)
    else:
        array = draw(hn.arrays(dtype, shape))
    for _ in range(draw(st.integers(0, 2))):
        way = draw(st.integers(0, 6))
        if way == 0:
            array = array[::-1] if array.ndim else array
        elif way == 1:
            array = np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim else array
        elif way == 2:
            array = np.asfortranarray(array)
        elif way == 3:
            array = array[..., ::-1] if array.ndim else array
        elif way == 4:
            array = np.broadcast_to(array, array.shape)
        elif way == 5 and array.dtype != object:
            raw = np.zeros(array.nbytes + 1, np.uint8)
            moved = raw[1:].view()[: array.nbytes]
            moved[:] = np.frombuffer(array.tobytes(), np.uint8)
            array = np.ndarray(array.shape, array.dtype, buffer=moved.data)
        elif way == 6:
            array = array.copy()
            array.flags.writeable = False
    return array


def anything(shape=None):
    others = st.sampled_from(
        [None, "text", 1, 1.5, [], {}, [[1, 2, 3]], [[1, 2], [3]], object(), b"x", (1, 2, 3), True]
    )
    return st.one_of(arrays(shape), arrays(shape), arrays(shape), others)


def tried(make):
    """What was made, or `None` where it was refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return make()
        except REFUSALS as refusal:
            assert str(refusal)
            return None


def shown(renderer, scene):
    """Renders what was made: it is a picture of numbers, or refused."""
    frame = tried(lambda: renderer.render(scene, mode="supersample:2", aovs=["depth", "velocity"]))
    if frame is not None:
        assert frame.rgba.shape[2] == 4 and np.isfinite(frame.rgba).all()
        tried(frame._repr_png_)


@LIMITS
@given(data=st.data())
def test_points(renderer, data):
    rows = data.draw(st.integers(0, 6))
    names = ["normals", "radii", "colors", "opacities", "velocities", "accelerations", "ids"]
    given_columns = {name: data.draw(anything((rows, 3))) for name in names if data.draw(st.booleans())}
    positions = data.draw(st.one_of(
        anything(), hn.arrays(np.float64, (rows, 3), elements=st.floats(-2, 2)), arrays((rows, 3))
    ))
    model = tried(lambda: sb.Points(positions, **given_columns))
    if model is not None:
        shown(renderer, sb.Scene(model, camera=front(16, 12)))


@LIMITS
@given(data=st.data())
def test_gaussians(renderer, data):
    rows = data.draw(st.integers(0, 4))
    columns = [data.draw(anything((rows, width))) for width in (3, 4, 3)]
    colours = data.draw(st.one_of(anything((rows, 3)), hn.arrays(np.float32, (rows, 4, 3))))
    key = data.draw(st.sampled_from(["sh", "colors"]))
    model = tried(lambda: sb.Gaussians(*columns, data.draw(anything((rows,))), **{key: colours}))
    if model is not None:
        shown(renderer, sb.Scene(model, camera=front(16, 12)))


@LIMITS
@given(data=st.data())
def test_numbers_of_good_gaussians(renderer, data):
    rows = data.draw(st.integers(1, 4))

    def draw(*shape):
        return data.draw(hn.arrays(np.float64, (rows, *shape), elements=st.one_of(NUMBERS, st.floats(0, 1))))

    model = tried(lambda: sb.Gaussians(draw(3), draw(4), draw(3), draw(), colors=draw(3)))
    if model is not None:
        shown(renderer, sb.Scene(model, camera=front(16, 12)))


MODEL = sb.Points(np.eye(3), normals=[0, 0, 1.0], radii=0.5)


@LIMITS
@given(data=st.data())
def test_cameras_and_poses(renderer, data):
    matrix = st.one_of(
        anything(), hn.arrays(np.float64, (4, 4), elements=NUMBERS), hn.arrays(np.float64, (2, 4, 4), elements=NUMBERS),
        st.just(np.eye(4)), st.just(np.stack([np.eye(4)] * 3)),
    )
    times = st.one_of(anything(), st.just(None), st.lists(NUMBERS, min_size=1, max_size=4))
    keys = {"K": anything(), "fovy": NUMBERS, "eye": anything(), "at": anything(), "up": anything(), "viewmat": matrix,
            "c2w": matrix, "times": times, "near": NUMBERS}
    options = {key: data.draw(value) for key, value in keys.items() if data.draw(st.integers(0, 3)) == 0}
    camera = tried(lambda: sb.Camera(16, 12, **options))
    poses = (data.draw(times), data.draw(matrix))
    thing = tried(lambda: sb.Object(MODEL, poses=poses))
    moved = tried(lambda: sb.Object(MODEL, transform=data.draw(matrix), opacity=data.draw(NUMBERS)))
    kept = [each for each in (thing, moved) if each is not None] or [sb.Object(MODEL)]
    scene = tried(lambda: sb.Scene(kept, camera=camera or front(16, 12)))
    if scene is not None:
        shown(renderer, scene)


@LIMITS
@given(data=st.data())
def test_settings_of_scenes(renderer, data):
    words = st.sampled_from(["box", "tent", "gaussian", "ramp:centre=9", "", "x", "gaussian:width=1e-9"])
    shutter = tried(lambda: sb.Shutter(data.draw(NUMBERS), data.draw(NUMBERS), data.draw(words), data.draw(NUMBERS)))
    keys = {"background": anything(), "environment": anything(), "rate": NUMBERS, "frames": anything(),
            "size": anything(), "lights": st.just([sb.Light("point", (0, 0, np.nan), (1, 1, 1))])}
    options = {key: data.draw(value) for key, value in keys.items() if data.draw(st.integers(0, 2)) == 0}
    scene = tried(lambda: sb.Scene(MODEL, shutter=shutter, camera=front(16, 12), **options))
    if scene is not None:
        number = data.draw(NUMBERS)
        tried(lambda: renderer.render(scene, number, mode="supersample:2"))


@LIMITS
@given(data=st.data())
def test_pictures(data):
    good = hn.arrays(np.float32, (12, 12, 4), elements=st.floats(width=32))
    a, b = (data.draw(st.one_of(anything(), good)) for _ in "ab")
    tried(lambda: sb.compare(a, b, ["flip", "ssim", "psnr"]))
    tried(lambda: sb.Frame(a)._repr_png_())
    tried(lambda: sb.colour_map(a, data.draw(st.sampled_from(["viridis", "x"]))))
    tried(lambda: sb.srgb_to_linear(a))


def test_arrays_that_are_bigger_than_memory():
    huge = np.broadcast_to(np.zeros(3), (10**6, 3))
    assert tried(lambda: len(sb.Points(huge[:1000]))) == 1000
    with pytest.raises(sb.InvalidValue, match="shape"):
        sb.Points(np.broadcast_to(np.zeros(3), (10**9, 10**3, 3)))
    with pytest.raises(sb.InvalidValue, match="width"):
        sb.Camera(10**9, 10, eye=(0, 0, 5), at=(0, 0, 0))


def test_a_frame_that_needs_more_than_its_memory_is_refused(renderer):
    scene = sb.Scene(MODEL, camera=sb.Camera(65_535, 65_535, eye=(0, 0, 5), at=(0, 0, 0)))
    with pytest.raises(sb.RenderError, match="memory="):
        renderer.render(scene)


def test_many_objects(renderer):
    things = [sb.Object(MODEL, transform=np.diag([0.01, 0.01, 0.01, 1.0])) for _ in range(20_000)]
    frame = renderer.render(sb.Scene(things, camera=front(16, 12)), mode="still")
    assert frame.rgba[6, 8, 0] > 0


def test_arrays_of_frames_that_were_spoiled(renderer, tmp_path):
    frame = renderer.render(sb.Scene(MODEL, camera=front(16, 12)), aovs=["depth"])
    frame.rgba[0, 0, 0] = np.nan
    with pytest.raises(sb.ImageError):
        frame.save(tmp_path / "a.png")
    frame.rgba = np.zeros((3, 3, 4), np.float32)
    with pytest.raises(sb.InvalidValue, match="depth"):
        frame.save(tmp_path / "a.exr")
    frame.rgba = "no"
    with pytest.raises(sb.InvalidValue):
        frame._repr_png_()


ATTRIBUTES = ["objects", "camera", "shutter", "lights", "background", "environment", "rate", "name"]


@pytest.mark.parametrize("attribute", ATTRIBUTES)
def test_attributes_that_were_spoiled(renderer, attribute):
    for value in (None, 7, "x", [1], object(), np.nan):
        scene = sb.load(SCENES / "swarm.xml", size=(16, 12))
        setattr(scene, attribute, value)
        tried(lambda: renderer.render(scene, 3, mode="still"))  # noqa: B023
