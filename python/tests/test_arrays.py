"""Arrays in, arrays out."""

from __future__ import annotations

import copy
import gc
import io
import os
import pickle
import time
import warnings

import numpy as np
import pytest
from conftest import ball, front, sphere, within

import splatblur as sb


def test_a_ball_is_round_lit_and_where_it_should_be(renderer):
    frame = renderer.render(sb.Scene(ball(), camera=front()), aovs=["alpha", "depth", "normal", "velocity"])
    assert frame.rgba.shape == (48, 64, 4) and frame.rgba.dtype == np.float32
    assert frame.rgba.flags.c_contiguous and frame.rgba.flags.writeable
    assert frame.layers == ("alpha", "depth", "normal", "velocity")
    # The outline of a unit sphere 5 away: asin(1/5) against a half field of view of 20 degrees.
    radius = 24 * np.tan(np.arcsin(0.2)) / np.tan(np.radians(20))
    assert frame.alpha.sum() == pytest.approx(np.pi * radius**2, rel=0.05)
    assert frame.depth[24, 32] == pytest.approx(4.0, abs=0.02)
    assert np.isinf(frame.depth[0, 0]) and frame.alpha[0, 0] == 0
    assert frame.normal.shape == (48, 64, 3) and frame.normal[24, 32, 2] == pytest.approx(1.0, abs=0.02)
    assert frame.velocity.shape == (48, 64, 2) and np.abs(frame.velocity).max() < 1e-6
    assert 0.05 < frame.rgba[24, 32, 0] < 1.0
    assert frame.stats["backend"] == "cpu" and 0 <= frame.stats["stated_error"] < 0.05


def test_velocities_move_points_by_their_unit(renderer):
    for unit, speed in [("second", 24.0), ("frame", 1.0)]:
        moving = ball(velocities=[speed, 0, 0], velocity_unit=unit)
        frame = renderer.render(sb.Scene(moving, camera=front()), aovs=["velocity"])
        # Half a frame of exposure, 1 unit a frame: half a unit at depth 4.
        wanted = 0.5 / 4.0 * 24 / np.tan(np.radians(20))
        assert frame.velocity[24, 32, 0] == pytest.approx(wanted, rel=0.05)


def test_colours_and_layers_are_the_renderers_own_memory(renderer):
    frame = renderer.render(sb.Scene(ball(), camera=front()), aovs=["depth"])
    assert frame.rgba.ctypes.data == frame._address
    assert np.shares_memory(np.asarray(frame), frame.rgba)
    assert np.shares_memory(np.from_dlpack(frame), frame.rgba)
    assert np.asarray(frame, dtype=np.float64).dtype == np.float64
    # Arrays outlive their frame and their renderer.
    rgba, before = frame.rgba, frame.rgba.copy()
    del frame
    gc.collect()
    renderer.render(sb.Scene(ball(), camera=front()))
    assert np.array_equal(rgba, before)


def test_a_million_points_are_copied_once_and_fast():
    points = sphere(1_000_000)
    columns = {
        "positions": points,
        "normals": points.astype(np.float32),
        "colours": np.full((1_000_000, 3), 0.5, np.float32),
        "radii": np.full(1_000_000, 0.003, np.float32),
    }
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        rows = sb._native.copied(columns)
        best = min(best, time.perf_counter() - start)
    assert rows == 1_000_000
    within(best, 0.06)


def test_inputs_may_be_anything_that_is_an_array():
    points = sphere(200)
    plain = ball(200)
    wide = np.zeros((200, 6))
    wide[:, ::2] = points
    backwards = points[::-1].copy()[::-1]
    locked = points.copy()
    locked.flags.writeable = False
    alike = [points.tolist(), wide[:, ::2], backwards, locked, points.astype(">f8"), np.asfortranarray(points)]
    columns = plain._native.columns()
    for given in alike:
        made = sb.Points(given, normals=given, radii=np.full(200, 3.0 / 200**0.5), colors=np.full((200, 3), 0.5))
        for name, column in made._native.columns().items():
            assert np.array_equal(column, columns[name]), name


def test_what_is_changed_or_freed_later_does_not_matter(renderer):
    points = sphere(500)
    model = sb.Points(points, normals=points, radii=np.full(500, 0.1))
    before = renderer.render(sb.Scene(model, camera=front())).rgba
    points[:] = np.nan
    del points
    gc.collect()
    assert np.array_equal(renderer.render(sb.Scene(model, camera=front())).rgba, before)


def test_estimates_are_warnings():
    with pytest.warns(sb.NoteWarning, match="normals of all 50 points estimated"):
        model = sb.Points(sphere(50))
    assert any("normals" in note for note in model.notes)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ball(50)


def test_pictures_are_shown_written_and_read(renderer, tmp_path):
    frame = renderer.render(sb.Scene(ball(), camera=front()), aovs=["depth", "velocity"])
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert frame.srgb8.shape == (48, 64, 4) and frame.srgb8.dtype == np.uint8
    frame.save(tmp_path / "a.exr")
    again = sb.read(tmp_path / "a.exr")
    assert np.array_equal(again.rgba, frame.rgba)
    assert np.array_equal(again.depth, frame.depth) and np.array_equal(again.velocity, frame.velocity)
    frame.save(tmp_path / "a.png")
    codes = np.round(255 * sb.linear_to_srgb(sb.read(tmp_path / "a.png").rgba[..., :3]))
    assert np.array_equal(codes, frame.srgb8[..., :3])
    frame.save(tmp_path / "b.png", bits=16)
    frame.save(tmp_path / "b.exr", bits=16, compression="piz")
    for name, options in [("c.jpg", {}), ("c.png", {"bits": 32}), ("c.exr", {"compression": "lzw"})]:
        with pytest.raises(sb.InvalidValue, match="expected .png"):
            frame.save(tmp_path / name, **options)
    assert "depth" in repr(frame)


def test_layers_that_were_not_rendered_say_how_to_get_them(renderer):
    frame = renderer.render(sb.Scene(ball(), camera=front()))
    with pytest.raises(AttributeError, match="aovs="):
        frame.depth
    assert not hasattr(frame, "velocity")


def test_layer_object_has_names(renderer):
    scene = sb.Scene([sb.Object(ball(), name="left"), ball()], camera=front())
    frame = renderer.render(scene, aovs="object")
    assert frame.object_names == ["left", "object2"] and frame.object.max() >= 1


def test_pictures_are_compared(renderer, tmp_path):
    scene = sb.Scene(ball(velocities=[24, 0, 0]), camera=front())
    rough, fine = renderer.render(scene, mode="supersample:2"), renderer.render(scene, mode="supersample:64")
    found = sb.compare(rough, fine, ("flip", "psnr", "rmse"))
    assert list(found) == ["flip", "psnr", "rmse"] and 0 < found["flip"] < 1
    assert found["rmse"] == pytest.approx(np.sqrt(np.mean((rough.rgba - fine.rgba)[..., :3].astype(float) ** 2)))
    fine.save(tmp_path / "fine.exr")
    assert sb.compare(fine.rgba[..., :3], tmp_path / "fine.exr", "rmse") == {"rmse": 0.0}
    with pytest.raises(sb.InvalidValue, match="differ in size"):
        sb.compare(rough, rough.rgba[:10])
    with pytest.raises(sb.InvalidValue, match="flip"):
        sb.compare(rough, fine, "flop")


def test_colour_maps_are_those_of_matplotlib():
    colours = sb.colour_map(np.array([0.0, 0.25, 0.5, 1.0, 7.0, np.nan]), "viridis", (0, 1))
    assert colours.shape == (6, 3) and np.array_equal(colours[3], colours[4]) and np.allclose(colours[5], 0.2)
    assert sb.color_map is sb.colour_map
    matplotlib = pytest.importorskip("matplotlib")
    places = np.linspace(0, 1, 500)
    for name in ["viridis", "plasma", "inferno", "magma", "cividis", "turbo", "coolwarm", "gray"]:
        wanted = matplotlib.colormaps[name](places)[:, :3]
        assert np.abs(sb.linear_to_srgb(sb.colour_map(places, name)) - wanted).max() < 0.025, name
    with pytest.raises(sb.InvalidValue, match="viridis"):
        sb.colour_map([1.0], "jet")


def test_spellings():
    colours = np.full((50, 3), 0.25)
    columns = [sb.Points(sphere(50), normals=sphere(50), **{name: colours})._native.columns() for name in
               ("colors", "colours")]
    assert np.array_equal(columns[0]["colour"], columns[1]["colour"])
    assert sb.Light.ambient(color=0.5) == sb.Light.ambient(0.5) and sb.Light.ambient(0.5).color == (0.5, 0.5, 0.5)
    with pytest.raises(TypeError, match="the same"):
        ball(colours=colours, colors=colours)


def test_a_jupyter_picture_decodes(renderer):
    image = pytest.importorskip("PIL.Image")
    frame = renderer.render(sb.Scene(ball(), camera=front()))
    shown = np.asarray(image.open(io.BytesIO(frame._repr_png_())).convert("RGBA"))
    assert np.array_equal(shown, frame.srgb8)


def test_frames_are_pickled(renderer, tmp_path):
    frame = renderer.render(sb.Scene(ball(), camera=front()), aovs="depth")
    again = pickle.loads(pickle.dumps(frame))
    assert np.array_equal(again.rgba, frame.rgba) and np.array_equal(again.depth, frame.depth)
    again.save(tmp_path / "a.exr")
    copy.deepcopy(frame).save(os.fsencode(tmp_path / "b.png"))
