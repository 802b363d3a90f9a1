"""The five scripts that a user would write first, as they are in docs/python.md."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENES

import splatblur as sb


def test_1_arrays_in_arrays_out():
    p = np.random.default_rng(0).normal(size=(20_000, 3)); p /= np.linalg.norm(p, axis=1, keepdims=True)
    with pytest.warns(sb.NoteWarning, match="radii"):
        ball = sb.Points(p, normals=p, colors=(p + 1) / 2, velocities=np.broadcast_to([9.0, 0, 0], p.shape))
    scene = sb.Scene([ball], camera=sb.Camera(640, 480, fovy=40, eye=(0, 0, 5), at=(0, 0, 0)))
    frame = sb.render(scene, aovs=["depth", "velocity"])
    assert frame.rgba.shape == (480, 640, 4) and frame.depth.dtype == np.float32 and frame.stats["stated_error"] < 0.03
    assert frame._repr_png_()


def test_2_a_capture_drives_through_another_one(tmp_path):
    torch = pytest.importorskip("torch")
    guitar = sb.Gaussians.load(SCENES / "models" / "guitar.compressed.ply")._native.columns()
    kept = slice(None, None, 8)
    count = len(guitar["position"][kept])
    opacity = torch.tensor(guitar["opacity"][kept]).clamp(1e-4, 1 - 1e-4)
    # What gsplat's trainer saves: parameters, with gradients, logarithms of scales and logits of opacities.
    splats = {
        "means": torch.tensor(guitar["position"][kept]),
        "quats": torch.tensor(guitar["rotation"][kept][:, [3, 0, 1, 2]]) * 3,
        "scales": torch.tensor(guitar["sigma"][kept]).clamp(min=1e-9).log(),
        "opacities": opacity.logit(),
        "sh0": torch.tensor(guitar["base"][kept])[:, None],
        "shN": torch.zeros(count, 15, 3),
    }
    torch.save({"step": 1, "splats": {k: v.requires_grad_() for k, v in splats.items()}}, tmp_path / "splats.pt")
    times = np.arange(5.0)
    car_poses = np.stack([np.eye(4)] * 5); car_poses[:, 0, 3] = times
    camera_poses = np.stack([np.eye(4)] * 5); camera_poses[:, 2, 3] = 6.0
    K = np.array([[60.0, 0, 48], [0, 60, 27], [0, 0, 1]])

    s = torch.load(tmp_path / "splats.pt", map_location="cpu")["splats"]
    car = sb.Gaussians(s["means"], s["quats"], s["scales"].exp(), s["opacities"].sigmoid(),
                       sh=torch.cat([s["sh0"], s["shN"]], 1))
    road = sb.Gaussians.load(SCENES / "models" / "guitar.compressed.ply")
    scene = sb.Scene([road, sb.Object(car, poses=(times, car_poses))],
                     camera=sb.Camera(96, 54, K=K, c2w=camera_poses, times=times),
                     shutter=sb.Shutter.seconds(1 / 50, fps=25, readout=0.02))
    frames = sb.Renderer().frames(scene, range(2), progress=True)
    assert len(frames) == 2
    for frame in frames:
        frame.save(tmp_path / f"{frame.number:04.0f}.exr")
    assert sb.read(tmp_path / "0001.exr").rgba.max() > 0.05


def test_3_a_data_set_that_is_rendered_while_it_is_read():
    torch = pytest.importorskip("torch")
    scene = sb.load(SCENES / "crossing.xml", size=(64, 36))
    net, criterion = torch.nn.Conv2d(3, 3, 3, padding=1), torch.nn.L1Loss()
    data = sb.Dataset(scene, frames=range(10, 14), sharp=7, noise=dict(shot=4000, read=0.002), response="gamma:2.2")
    losses = []
    for batch in torch.utils.data.DataLoader(data, batch_size=2, shuffle=True):
        loss = criterion(net(batch["blurred"]), batch["sharp"][:, 3])
        losses.append(float(loss.detach()))
        assert batch["flow_open_close"].shape == (2, 2, 36, 64) and batch["c2w_open"].shape == (2, 4, 4)
    assert len(losses) == 2 and all(0 < loss < 2 for loss in losses)


def test_4_how_wrong_is_it():
    scene = sb.load(SCENES / "crossing.xml", size=(96, 54))
    errors = {}
    r = sb.Renderer(device="cpu"); truth = r.reference(scene, 12, samples=256)
    for mode in ["supersample:8", "supersample:32", "auto:final"]:
        f = r.render(scene, 12, mode=mode); errors[mode] = sb.compare(f, truth)["flip"], f.stats["seconds"]
    assert errors["supersample:32"][0] < errors["supersample:8"][0] < 0.2
    assert truth.standard_error.shape == (54, 96, 4) and 0 < truth.stats["stated_error"] < 0.02


def test_5_a_scene_file_one_thing_changed(tmp_path):
    scene = sb.load(SCENES / "crossing.xml", size=(480, 270))
    scene.shutter = sb.Shutter(-0.5, 0.5, weight="tent"); scene["ball"].blur = False
    sb.render(scene, 12).save(tmp_path / "crossing.png")
    assert sb.read(tmp_path / "crossing.png").rgba.shape == (270, 480, 4)


def shaken(number: float) -> sb.Scene:
    """Glue for pairs with random shakes, a rolling shutter and a gamma: what stands in docs/python.md, 11 lines."""
    rng = np.random.default_rng(int(number))
    times = np.linspace(number - 1, number + 1, 9)
    poses = np.stack([np.eye(4)] * 9)
    poses[:, :3, 3] = [0, 0.72, 6] + 0.05 * rng.normal(size=(9, 3))
    scene = sb.load(SCENES / "crossing.xml", size=(64, 36))
    scene.camera = sb.Camera(64, 36, fovy=34, c2w=poses, times=times)
    scene.shutter = sb.Shutter(-0.5, 0.5, readout=0.6)
    return scene


def test_pairs_with_random_shakes():
    data = sb.Dataset(shaken, frames=range(200), noise=dict(shot=4000), response="gamma:2.2", bits=8)
    assert len(data) == 200
    pairs = [data[0], data[199]]
    assert pairs[0]["blurred"].dtype == np.uint8 and pairs[0]["sharp"].shape == (3, 3, 36, 64)
    assert not np.array_equal(pairs[0]["c2w_open"], pairs[1]["c2w_open"])
    assert not np.array_equal(pairs[0]["c2w_open"], pairs[0]["c2w_close"])
