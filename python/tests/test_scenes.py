"""Cameras, shutters, objects and scene files."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from conftest import ROOT, SCENES, ball, front, sphere

import splatblur as sb


def turn_y(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def shifted(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def middle(frame: sb.Frame) -> np.ndarray:
    """Centre of what is seen, pixels."""
    y, x = np.indices(frame.alpha.shape) + 0.5
    return np.array([(x * frame.alpha).sum(), (y * frame.alpha).sum()]) / frame.alpha.sum()


def seen(renderer: sb.Renderer, camera: sb.Camera, at: tuple[float, float, float], frame: float = 0) -> np.ndarray:
    small = sb.Object(ball(400), transform=shifted(*at) @ np.diag([0.1, 0.1, 0.1, 1]))
    return middle(renderer.render(sb.Scene([small], camera=camera), frame, aovs="alpha"))


def test_the_keyword_of_a_camera_is_its_convention(renderer):
    K = np.array([[80.0, 0, 30.0], [0, 80.0, 26.0], [0, 0, 1]])
    # A camera 4 in front of the origin, turned a little, by the OpenCV convention.
    world_from_camera = shifted(0.3, -0.2, 4.0) @ turn_y(170)
    world_from_camera[:3, 1] *= -1
    world_from_camera[:3, 0] *= -1
    viewmat = np.linalg.inv(world_from_camera)
    assert np.linalg.det(viewmat[:3, :3]) == pytest.approx(1)
    point = np.array([0.2, 0.3, -0.1, 1.0])
    x, y, depth, _ = viewmat @ point
    assert depth > 0
    wanted = np.array([K[0, 0] * x / depth + K[0, 2], K[1, 1] * y / depth + K[1, 2]])
    c2w = world_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0])
    for camera in [
        sb.Camera(64, 48, K=K, viewmat=viewmat),
        sb.Camera(64, 48, K=K, c2w=c2w),
        sb.Camera(64, 48, K=K, c2w=c2w[:3]),
        sb.Camera(64, 48, K=K, c2w=[c2w, c2w], times=[0, 10]),
    ]:
        assert seen(renderer, camera, tuple(point[:3])) == pytest.approx(wanted, abs=0.1)
        assert camera.K == pytest.approx(K)
        assert sb.Scene(ball(), camera=camera).camera_to_world(0) == pytest.approx(c2w, abs=1e-9)


def test_cameras_move_with_times(renderer):
    c2w = np.stack([shifted(0, 0, 5), shifted(1, 0, 5)])
    camera = sb.Camera(64, 48, fovy=40, c2w=c2w, times=[0, 10])
    scene = sb.Scene(ball(), camera=camera)
    assert scene.frames == range(0, 11)
    assert scene.camera_to_world(2.5)[0, 3] == pytest.approx(0.25)
    assert scene.camera_to_world(99)[0, 3] == pytest.approx(1.0)
    still, moved = (renderer.render(scene, frame, aovs="velocity").velocity[24, 32] for frame in (20, 5))
    assert np.abs(still).max() < 1e-6 and moved[0] < -0.5


def test_cameras_that_cannot_be(renderer):
    wrong = [
        (TypeError, "once", {"eye": (0, 0, 5), "at": (0, 0, 0), "c2w": np.eye(4)}),
        (TypeError, "need `times`", {"c2w": [np.eye(4)] * 2}),
        (sb.InvalidValue, "rise|more than", {"c2w": [np.eye(4)] * 2, "times": [1, 1]}),
        (sb.InvalidValue, "singular", {"viewmat": np.diag([0.0, 1, 1, 1])}),
        (sb.InvalidValue, "matri|singular|translation", {"c2w": np.diag([0.0, 1, 1, 1])}),
        (sb.InvalidValue, "shape", {"c2w": np.eye(3)}),
        (sb.InvalidValue, "last row", {"c2w": np.ones((4, 4))}),
        (sb.InvalidValue, "finite", {"c2w": np.full((4, 4), np.nan)}),
        (sb.InvalidValue, "square", {"c2w": np.eye(4), "K": np.diag([80.0, 90, 1])}),
        (sb.InvalidValue, "fovy", {"eye": (0, 0, 5), "at": (0, 0, 0), "fovy": 180}),
        (TypeError, "not both", {"eye": (0, 0, 5), "at": (0, 0, 0), "fovy": 40, "K": np.eye(3)}),
    ]
    for error, message, options in wrong:
        with pytest.raises(error, match=message):
            sb.Camera(64, 48, **options)
    with pytest.raises(sb.InvalidValue, match="width"):
        sb.Camera(0, 48)
    with pytest.raises(sb.InvalidValue, match="camera"):
        renderer.render(sb.Scene(ball(), camera=sb.Camera(64, 48, eye=(0, 0, 5), at=(0, 0, 5))))


def test_a_camera_is_found(renderer):
    frame = renderer.render(sb.Scene(ball(), camera=sb.Camera(64, 48)), aovs="alpha")
    assert middle(frame) == pytest.approx([32, 24], abs=0.3) and frame.alpha.max() == pytest.approx(1)
    assert renderer.render(sb.Scene(ball(), size=(80, 60))).rgba.shape == (60, 80, 4)


def test_objects_go_through_poses_after_their_transform(renderer):
    poses = (np.array([0.0, 4.0]), np.stack([np.eye(4), shifted(2, 0, 0)]))
    thing = sb.Object(ball(), transform=turn_y(90) @ shifted(0, 0, 1), poses=poses)
    # turn_y(90) takes +z to +x.
    assert thing.pose_at(1.0)[:3, 3] == pytest.approx([1.5, 0, 0])
    assert thing.transform == pytest.approx(turn_y(90) @ shifted(0, 0, 1), abs=1e-12)
    again = pickle.loads(pickle.dumps(thing))
    assert again.pose_at(1.0) == pytest.approx(thing.pose_at(1.0))
    scene = sb.Scene([thing], camera=front())
    assert scene.frames == range(0, 5)
    moving = renderer.render(scene, 2)
    thing.blur = False
    assert not np.array_equal(renderer.render(scene, 2).rgba, moving.rgba)


@pytest.mark.parametrize("seed", range(5))
def test_transforms_are_taken_apart_and_put_together(seed):
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = q @ np.diag(rng.uniform(0.5, 2, 3)), rng.normal(size=3)
    assert sb.Object(ball(50), transform=matrix).transform == pytest.approx(matrix, abs=1e-9)
    sheared = matrix @ np.array([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    with pytest.raises(sb.InvalidValue, match="transform"):
        sb.Object(ball(50), transform=sheared)


def test_shutters_in_seconds_set_the_rate():
    shutter = sb.Shutter.seconds(1 / 50, fps=25, readout=0.02)
    assert (shutter.open, shutter.close, shutter.readout) == pytest.approx((-0.25, 0.25, 0.5))
    assert sb.Scene(ball(), shutter=shutter).rate == 25
    with pytest.raises(sb.InvalidValue, match="25"):
        sb.Scene(ball(), shutter=shutter, rate=24)
    for wrong in [{"open": 1.0, "close": 0.0}, {"weight": "wide"}, {"direction": "inwards"}, {"readout": -1.0}]:
        with pytest.raises(sb.InvalidValue):
            sb.Scene(ball(), shutter=sb.Shutter(**wrong))


def test_a_rolling_shutter_bends(renderer):
    streak = sb.Object(ball(), velocity=(1.0, 0, 0))
    rolls = sb.Scene([streak], camera=front(), shutter=sb.Shutter(-0.01, 0.01, readout=1.0))
    alpha = renderer.render(rolls, aovs="alpha").alpha
    x = np.arange(64) + 0.5
    upper, lower = ((alpha[rows] * x).sum() / alpha[rows].sum() for rows in (slice(0, 24), slice(24, 48)))
    assert lower - upper > 1.0


def test_lights_and_backgrounds(renderer):
    dark = sb.Scene(ball(), camera=front(), lights=[], background=(0.1, 0.2, 0.3))
    frame = renderer.render(dark)
    assert frame.rgba[0, 0] == pytest.approx([0.1, 0.2, 0.3, 1]) and frame.rgba[24, 32, :3].max() == 0
    lit = sb.Scene(ball(), camera=front(), lights=[sb.Light.ambient(0.5)], transparent=True)
    frame = renderer.render(lit)
    assert frame.rgba[24, 32] == pytest.approx([0.25, 0.25, 0.25, 1], abs=0.01) and frame.rgba[0, 0].max() == 0
    around = np.full((8, 16, 3), 0.4, np.float32)
    frame = renderer.render(sb.Scene(ball(), camera=front(), environment=around))
    assert frame.rgba[0, 0, :3] == pytest.approx(0.4, abs=1e-3)
    with pytest.raises(sb.InvalidValue, match="environment"):
        sb.Environment(np.zeros((8, 8, 3)))


def test_environments_light_scenes(renderer):
    sky = np.zeros((32, 64, 3), np.float32)
    sky[:16] = 1.0
    white = ball(colors=np.ones((2_000, 3)))

    def level(**settings):
        scene = sb.Scene(white, camera=front(), environment=sb.Environment(sky, background=False), **settings)
        return renderer.render(scene, shadows=False).rgba[24, 32, 0]

    # A level normal sees half of the sky. Lights of a scene's own take its place, unless it says that it is one.
    assert level() == pytest.approx(0.5, abs=0.05)
    assert level(lights=[]) == 0.0
    lit = sb.Environment(sky, background=False, light=True, shadows=False)
    frame = renderer.render(sb.Scene(white, camera=front(), environment=lit, lights=[]))
    assert frame.rgba[24, 32, 0] == pytest.approx(0.5, abs=0.05)
    unlit = sb.Environment(sky, background=False, light=False)
    plain = renderer.render(sb.Scene(white, camera=front(), environment=unlit)).rgba
    assert np.array_equal(plain, renderer.render(sb.Scene(white, camera=front())).rgba)
    with pytest.raises(sb.InvalidValue, match="light"):
        sb.Environment(sky, light="maybe")


def test_environments_of_files_are_replaced(renderer, tmp_path):
    def sky(level):
        return sb.Environment(np.full((8, 16, 3), level, np.float32), background=False, shadows=False)

    made = sb.Scene(ball(), camera=front(), environment=sky(0.5))
    made.save(tmp_path / "lit.xml")
    scene = sb.load(tmp_path / "lit.xml")
    assert scene.lights is None
    scene.environment = sky(1.0)
    made.environment = sky(1.0)
    assert np.abs(renderer.render(scene).rgba - renderer.render(made).rgba).max() < 1e-6
    # Without one there are the lamps that a scene has by default.
    scene.environment = None
    made.environment = None
    lamps = renderer.render(made).rgba
    assert lamps[24, 32, 0] > 0.1 and np.abs(renderer.render(scene).rgba - lamps).max() < 1e-6


def test_scene_files_are_loaded_changed_and_saved(renderer, tmp_path):
    scene = sb.load(SCENES / "crossing.xml", size=(48, 27))
    assert scene.name == "crossing" and scene.frames == range(4, 21) and scene.size == (48, 27)
    assert [each.name for each in scene.objects] == ["guanyin", "ball"] and scene["ball"].blur
    with pytest.raises(KeyError, match="guanyin"):
        scene["bell"]
    before = renderer.render(scene, 12).rgba
    scene["ball"].blur = False
    posed = renderer.render(scene, 12).rgba
    scene.shutter = sb.Shutter(-0.5, 0.5, weight="tent")
    changed = renderer.render(scene, 12).rgba
    assert not np.array_equal(before, posed) and not np.array_equal(posed, changed)
    scene.save(tmp_path / "changed.xml")
    assert np.array_equal(renderer.render(sb.load(tmp_path / "changed.xml"), 12).rgba, changed)
    scene.camera = front(48, 27)
    assert not np.array_equal(renderer.render(scene, 12).rgba, changed)


def test_scenes_in_code_are_saved_with_their_models(renderer, tmp_path):
    moving = sb.Object(ball(velocities=[1.0, 0, 0]), name="ball", velocity=(0.5, 0, 0), opacity=0.5)
    scene = sb.Scene([moving], camera=front(), background=0.2)
    scene.save(tmp_path / "made.xml")
    assert (tmp_path / "made.ball.bin").exists()
    again = sb.load(tmp_path / "made.xml")
    assert np.array_equal(renderer.render(again, 3).rgba, renderer.render(scene, 3).rgba)
    scene.objects[0].poses = ([0.0], [np.eye(4)])
    with pytest.raises(sb.InvalidValue, match="poses"):
        scene.save(tmp_path / "made.xml")


def test_scenes_are_pickled(renderer):
    loaded = sb.load(SCENES / "guitar_ball.xml", size=(48, 27))
    loaded.shutter = sb.Shutter(-0.5, 0.5)
    loaded.objects[0].opacity = 0.5
    flight = sb.load(SCENES / "guitar_flight.xml", size=(48, 27))
    made = sb.Scene(
        [sb.Object(ball(), velocity=(1, 0, 0)), ball(velocities=[24, 0, 0])],
        camera=sb.Camera(48, 27, c2w=[shifted(0, 0, 5), shifted(0, 1, 5)], times=[0, 9]),
        environment=np.full((4, 8, 3), 0.1, np.float32),
        lights=[sb.Light.point((1, 2, 3), (10, 20, 30))],
    )
    for scene in (loaded, flight, made):
        again = pickle.loads(pickle.dumps(scene))
        assert np.array_equal(renderer.render(again, 3).rgba, renderer.render(scene, 3).rgba)


def test_lights_have_shadows(renderer):
    places = np.array([[x / 4, -1.2, z / 4] for x in range(-12, 13) for z in range(-12, 13)])
    up = np.tile([0.0, 1.0, 0.0], (625, 1))
    floor = sb.Points(places, normals=up, radii=np.full(625, 0.3), colors=np.full((625, 3), 0.5))
    sun = sb.Light.directional((0.3, -1, -0.2), angle=1, shadows=True)
    assert (sun.size, sun.shadows) == (1.0, True)
    scene = sb.Scene([ball(), floor], camera=front(48, 36), lights=[sun])
    lit = renderer.render(scene, mode="supersample:4", shadows=False).rgba
    dark = renderer.render(scene, mode="supersample:4").rgba
    assert (dark[..., :3] <= lit[..., :3] + 1e-3).all() and (lit - dark)[..., 0].max() > 0.2
    again = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(renderer.render(again, mode="supersample:4").rgba, dark)

    def brightness(**told: bool) -> float:
        things = [sb.Object(model, **told) for model in (ball(), floor)]
        scene = sb.Scene(things, camera=front(48, 36), lights=[sun])
        return float(renderer.render(scene, mode="supersample:4").rgba[..., 0].mean())

    assert brightness() == pytest.approx(dark[..., 0].mean())
    for told in ({"cast_shadows": False}, {"receive_shadows": False}):
        assert brightness(**told) == pytest.approx(lit[..., 0].mean(), rel=0.01) != dark[..., 0].mean()
    swept = [renderer.render(scene, mode="volumetric:2", shadows=shadows).rgba for shadows in (True, False)]
    assert (swept[1] - swept[0])[..., 0].max() > 0.2


def test_models_are_loaded_by_path(renderer):
    models = SCENES / "models"
    scene = sb.Scene([sb.Object(models / "ball.ply", name="b"), models / "spot.sfl"], size=(48, 36))
    assert [each.model.kind for each in scene.objects] == ["surfels"] * 2
    assert renderer.render(scene, aovs="object").object.max() == 2
    again = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(renderer.render(again).rgba, renderer.render(scene).rgba)
    lone = sb.load(SCENES / "models" / "ball.ply", size=(48, 36))
    assert len(lone) == 1 and renderer.render(lone).rgba.max() > 0.05


def test_errors_name_file_line_found_and_expected(tmp_path):
    with pytest.raises(FileNotFoundError):
        sb.load(tmp_path / "none.xml")
    (tmp_path / "a.xml").write_text("<scene>\n <object>\n  <pointModle>x.ply</pointModle>\n </object>\n</scene>\n")
    with pytest.raises(sb.SceneError) as refused:
        sb.load(tmp_path / "a.xml")
    error = refused.value
    assert (error.file, error.line, error.column) == (str(tmp_path / "a.xml"), 3, 3)
    assert error.found == "`pointModle`" and "pointModel" in (error.expected or "")
    (tmp_path / "b.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex x\nend_header\n")
    with pytest.raises(sb.ModelError) as refused:
        sb.Model.load(tmp_path / "b.ply")
    error = refused.value
    assert (error.file, error.line) == (str(tmp_path / "b.ply"), 3) and error.found and error.expected
    assert isinstance(error, ValueError) and isinstance(error, sb.SplatblurError)
    text = '<scene>\n <object whoKnows="1">\n  <pointModel>{}</pointModel>\n </object>\n</scene>'
    (tmp_path / "c.xml").write_text(text.format(ROOT / "scenes" / "models" / "ball.ply"))
    with pytest.warns(sb.NoteWarning, match="whoKnows"):
        sb.load(tmp_path / "c.xml", lenient=True)


def test_captures_are_saved_as_ply(renderer, tmp_path):
    guitar = sb.Gaussians.load(SCENES / "models" / "guitar.compressed.ply")
    made = type(guitar)._of(sb._native.Object.of_columns(guitar._native.columns()))
    scene = sb.Scene([sb.Object(made, name="g")], size=(48, 36))
    assert scene.objects[0].model.kind == "gaussians"
    scene.save(tmp_path / "a.xml")
    assert (tmp_path / "a.g.ply").exists()
    a, b = (renderer.render(each).rgba for each in (scene, sb.load(tmp_path / "a.xml")))
    # PLY holds logits and logarithms, which round.
    assert a.max() > 0.1 and np.abs(a - b).max() < 1e-3
    rng = np.random.default_rng(4)
    sh = rng.normal(size=(9, 16, 3))
    rich = sb.Gaussians(rng.normal(size=(9, 3)), rng.normal(size=(9, 4)), np.full((9, 3), 0.2), np.full(9, 0.7), sh=sh)
    scene = sb.Scene(sb.Object(rich, name="g"), size=(48, 36))
    scene.save(tmp_path / "b.xml")
    a, b = (renderer.render(each).rgba for each in (scene, sb.load(tmp_path / "b.xml")))
    assert a.max() > 0.1 and np.abs(a - b).max() < 1e-3


def test_gaussians_have_gsplats_names_and_shapes(renderer):
    rng = np.random.default_rng(5)
    n = 40
    means, scales = rng.normal(size=(n, 3)), rng.uniform(0.05, 0.2, (n, 3))
    quats, opacities = rng.normal(size=(n, 4)), rng.uniform(0.3, 1, n)
    colours = rng.uniform(0, 1, (n, 3))
    camera = front()
    by_colour = sb.Gaussians(means, quats, scales, opacities, colors=colours)
    # Any length of a quaternion is the same rotation; the harmonic of degree 0 is 1 / (2 sqrt(pi)).
    base = (colours - 0.5) * 2 * np.sqrt(np.pi)
    by_sh = sb.Gaussians(means, quats * 7, scales, opacities, sh=base[:, None])
    a, b = (renderer.render(sb.Scene(model, camera=camera)).rgba for model in (by_colour, by_sh))
    assert a.max() > 0.2 and np.abs(a - b).max() < 1e-5
    # Coefficients of higher degrees turn colours with the direction.
    sh = np.concatenate([base[:, None], rng.normal(size=(n, 15, 3)) * 0.3], axis=1)
    c = renderer.render(sb.Scene(sb.Gaussians(means, quats, scales, opacities, sh=sh), camera=camera)).rgba
    assert np.abs(c - a).max() > 0.01
    # One long Gaussian that a quaternion with w first turns by 90 degrees about z.
    for quat, tall in [((1, 0, 0, 0), False), ((0.5**0.5, 0, 0, 0.5**0.5), True)]:
        one = sb.Gaussians([[0, 0, 0]], [quat], [[0.5, 0.05, 0.05]], [1.0], colors=[[1, 1, 1]])
        light = renderer.render(sb.Scene(one, camera=camera), mode="still").rgba[..., 0]
        assert ((light > 0.1).any(axis=1).sum() > (light > 0.1).any(axis=0).sum()) == tall
    again = pickle.loads(pickle.dumps(by_sh))
    assert np.array_equal(renderer.render(sb.Scene(again, camera=camera)).rgba, b)
    spoiled = [{"quats": np.zeros((n, 4))}, {"scales": -scales}, {"opacities": opacities + 1}]
    spoiled += [{"means": means * np.nan}]
    for wrong in spoiled:
        given = {"means": means, "quats": quats, "scales": scales, "opacities": opacities, "colors": colours} | wrong
        with pytest.raises(sb.InvalidValue):
            sb.Gaussians(given.pop("means"), given.pop("quats"), given.pop("scales"), given.pop("opacities"), **given)
    with pytest.raises(TypeError, match="one of them"):
        sb.Gaussians(means, quats, scales, opacities)
    with pytest.raises(sb.InvalidValue, match="K = 1"):
        sb.Gaussians(means, quats, scales, opacities, sh=np.zeros((n, 5, 3)))


def test_columns_that_do_not_fit_are_refused():
    points = sphere(10)
    wrong = [
        ("positions", {"positions": points[:, :2]}),
        ("positions", {"positions": points[0]}),
        ("positions", {"positions": points.astype(complex)}),
        ("positions", {"positions": np.array(["a"] * 10)}),
        ("positions", {"positions": points.astype(object)}),
        ("positions", {"positions": None}),
        ("normals", {"normals": points[:9]}),
        ("radii", {"radii": points}),
        ("colours", {"colors": (points * 255).astype(np.uint8)}),
        ("ids", {"ids": np.arange(10.0)}),
        ("velocity_unit", {"velocity_unit": "minute"}),
    ]
    for field, given in wrong:
        with pytest.raises(sb.InvalidValue) as refused:
            sb.Points(given.pop("positions", points), **given)
        assert refused.value.field == field
    for empty in (np.zeros((0, 3)), np.full((5, 3), np.nan)):
        with pytest.raises(sb.ModelError, match="no usable points"):
            sb.Points(empty)


@pytest.mark.parametrize("rate", [12, 24, 25, 30, 60])
def test_frames_are_those_of_all_poses_at_any_rate(rate):
    poses = np.stack([np.eye(4)] * 31)
    moving = sb.Object(ball(), poses=(np.arange(31.0), poses))
    assert sb.Scene([moving], camera=front(), rate=rate).frames == range(31)
    camera = sb.Camera(48, 27, c2w=[shifted(0, 0, 5), shifted(0, 1, 5)], times=[-2, 40])
    assert sb.Scene([moving], camera=camera, rate=rate).frames == range(-2, 41)
    assert sb.Scene([ball()], camera=camera, rate=rate).frames == range(-2, 41)


def test_what_is_saved_shows_the_same_picture(renderer, tmp_path):
    rng = np.random.default_rng(6)
    capture = sb.Gaussians(
        rng.normal(size=(9, 3)), rng.normal(size=(9, 4)), np.full((9, 3), 0.05), np.full(9, 0.7),
        colors=rng.uniform(0, 1, (9, 3)), antialiased=True,
    )
    sky = rng.uniform(0, 1, (8, 16, 3)).astype(np.float32)
    scenes = {
        "dark": sb.Scene(ball(), camera=front(), lights=[]),
        "antialiased": sb.Scene(capture, camera=front(32, 24)),
        "sky": sb.Scene(ball(), camera=front(), environment=sb.Environment(sky, rotation=30, intensity=2)),
        "names": sb.Scene(
            [ball(), sb.Object(ball(), name="object1", transform=shifted(1, 0, 0)), sb.Object(ball(), name="a/b"),
             sb.Object(ball(), name="a_b", transform=shifted(-1, 0, 0))],
            camera=front(),
        ),
    }
    for name, scene in scenes.items():
        scene.save(tmp_path / f"{name}.xml")
        a, b = (renderer.render(each).rgba for each in (scene, sb.load(tmp_path / f"{name}.xml")))
        assert np.abs(a - b).max() < (1e-3 if name == "antialiased" else 1e-6), name
    # A black picture would be the same in each case but that of darkness.
    assert renderer.render(scenes["dark"]).rgba[..., :3].max() == 0.0
    plain = renderer.render(sb.Scene(sb.Gaussians._of(capture._native), camera=front(32, 24)), mode="still").rgba
    assert plain[..., :3].max() > 0.01


def test_what_no_file_can_hold_is_refused_before_anything_is_written(tmp_path):
    K = [[40, 0, 10], [0, 40, 12], [0, 0, 1]]
    axis = sb.Scene(ball(), camera=sb.Camera(32, 24, K=K, eye=(0, 0, 5), at=(0, 0, 0)))
    linear = sb.Gaussians(np.zeros((1, 3)), [[1, 0, 0, 0]], [[1, 1, 1]], [1], colors=[[1, 1, 1]], linear=True)
    for scene, field in ((axis, "K"), (sb.Scene([ball(), linear], camera=front()), "capture object2")):
        with pytest.raises(sb.InvalidValue) as raised:
            scene.save(tmp_path / "never.xml")
        assert raised.value.field == field
    assert not list(tmp_path.iterdir())


def test_names_are_unique_and_of_one_line():
    with pytest.raises(sb.InvalidValue, match="'dup'"):
        sb.Scene([sb.Object(ball(), name="dup"), sb.Object(ball(), name="dup")], camera=front())
    for name in ("a\nb", " ", "a ", "\x1b[31m"):
        with pytest.raises(sb.InvalidValue, match="one line"):
            sb.Object(ball(), name=name)


def test_matrices_of_cameras_are_rotations():
    view = np.diag([1.0, -1.0, -1.0, 1.0])
    view[2, 3] = 5.0
    for given in (np.diag([-1.0, -1.0, -1.0, 1.0]) @ view, np.diag([1.0, 1.0, 3.0, 1.0]) @ view, np.diag([0.0, 1, 1, 1])):
        for keyword in ("viewmat", "c2w"):
            with pytest.raises(sb.InvalidValue) as raised:
                sb.Camera(32, 24, **{keyword: given})
            assert raised.value.field == keyword
    # One scale of all axes changes no picture.
    scaled = np.diag([2.0, 2.0, 2.0, 1.0]) @ view
    same = [sb.render(sb.Scene(ball(), camera=sb.Camera(32, 24, viewmat=each)), mode="still") for each in (view, scaled)]
    assert np.abs(same[0].rgba - same[1].rgba).max() < 1e-5


def test_poses_do_not_pass_through_a_flat_one():
    mirrored = np.diag([-1.0, 1.0, 1.0, 1.0])
    with pytest.raises(sb.InvalidValue, match="mirrors"):
        sb.Object(ball(), poses=([0, 1], [np.eye(4), mirrored]))
    sb.Object(ball(), poses=([0, 1], [mirrored, mirrored]))


def test_misspelt_and_meaningless_values_are_refused():
    scene = sb.Scene(ball(), camera=front())
    for thing, name in ((scene, "shuter"), (scene.objects[0], "opacty")):
        with pytest.raises(AttributeError, match=name):
            setattr(thing, name, 1)
    refused = {
        "velocity": lambda: sb.Object(ball(), velocity=1),
        "colours": lambda: ball(colors=np.full((2_000, 3), -0.1)),
        "near": lambda: sb.Camera(4, 4, eye=(0, 0, 1), at=(0, 0, 0), near=-1),
        "error": lambda: sb.Renderer("cpu").reference(scene, error=-1),
        "environment": lambda: sb.Environment(np.full((2, 4, 3), 200, np.uint8)),
        "rgba": lambda: sb.Frame(np.full((2, 4, 3), 200, np.uint8)),
        "transparent": lambda: sb.Scene(ball(), camera=front(), transparent="no"),
        "model": lambda: sb.Object(np.zeros((3, 3))),
        "objects": lambda: sb.Scene("scenes/crossing.xml"),
        "velocities[0]": lambda: ball(velocities=[1e30, 0, 0]),
        "weight": lambda: sb.Shutter(weight="bax"),
        "direction": lambda: sb.Shutter(direction="left-ish"),
        "close": lambda: sb.Shutter(0.25, -0.25),
        "mode": lambda: sb.render(scene, mode="stil"),
        "frame": lambda: sb.render(scene, np.inf),
    }
    for field, make in refused.items():
        with pytest.raises(sb.InvalidValue) as raised:
            make()
        assert raised.value.field == field, raised.value
        assert "Vec3" not in raised.value.message and "expected another" not in raised.value.message
    with pytest.raises(TypeError, match="neither"):
        sb.Camera(4, 4, near=1)
    with pytest.raises(TypeError, match="'shadng'.*shading"):
        sb.render(scene, shadng="phong")
