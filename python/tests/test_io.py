"""Files of other programs, each made by the library of its format."""

from __future__ import annotations

import json
import os
import subprocess

import numpy as np
import pytest
from conftest import SCENES, ball, sphere

import splatblur as sb
import splatblur.io


def middle(frame: sb.Frame) -> np.ndarray:
    y, x = np.indices(frame.alpha.shape) + 0.5
    return np.array([(x * frame.alpha).sum(), (y * frame.alpha).sum()]) / frame.alpha.sum()


# --- USD

@pytest.fixture
def stage(tmp_path):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    made = usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    made.SetTimeCodesPerSecond(25)
    made.SetStartTimeCode(1)
    made.SetEndTimeCode(5)
    return made


def usd_points(stage, path="/points", count=2_000, radius=1.0):
    from pxr import UsdGeom, Vt

    points = UsdGeom.Points.Define(stage, path)
    places = sphere(count, radius).astype(np.float32)
    points.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(places))
    points.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(places / radius))
    points.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.full(count, 6 * radius / count**0.5, np.float32)))
    points.CreateDisplayColorPrimvar("constant").Set([(0.5, 0.25, 0.125)])
    return points


def test_usd_points_with_velocities_and_a_camera(stage, renderer):
    from pxr import Gf, UsdGeom, Vt

    points = usd_points(stage)
    points.CreateVelocitiesAttr(Vt.Vec3fArray(2_000, Gf.Vec3f(25, 0, 0)))
    UsdGeom.Xformable(points).AddTranslateOp().Set(Gf.Vec3d(0, 1, 0))
    camera = UsdGeom.Camera.Define(stage, "/camera")
    camera.CreateHorizontalApertureAttr(24.0)
    camera.CreateVerticalApertureAttr(18.0)
    camera.CreateFocalLengthAttr(24.0)
    camera.CreateShutterOpenAttr(-0.25)
    camera.CreateShutterCloseAttr(0.25)
    move = UsdGeom.Xformable(camera).AddTranslateOp()
    move.Set(Gf.Vec3d(0, 1, 6), 1.0)
    move.Set(Gf.Vec3d(4, 1, 6), 5.0)
    stage.Save()
    scene = splatblur.io.usd.load(stage.GetRootLayer().realPath, size=(64, 48))
    assert scene.rate == 25 and scene.frames == range(1, 6)
    assert (scene.shutter.open, scene.shutter.close) == (-0.25, 0.25)
    assert scene.camera_to_world(2.0)[:3, 3] == pytest.approx([1, 1, 6])
    # focal 24 of a height of 18: f = 24 / 18 * 48 pixels.
    assert scene.camera.K == pytest.approx(np.array([[64, 0, 32], [0, 64, 24], [0, 0, 1]]))
    assert scene.objects[0].transform[:3, 3] == pytest.approx([0, 1, 0])
    frame = renderer.render(scene, 1, aovs=["velocity", "alpha"])
    # 25 units a second are one a frame: half of it within the shutter, less what the camera follows, at depth 5.
    assert frame.velocity[24, 32, 0] == pytest.approx(64 * 0.5 / 5 - 64 * 0.25 / 5, rel=0.02)
    column = scene.objects[0].model._native.columns()
    assert np.allclose(column["colour"], [0.5, 0.25, 0.125])
    assert np.allclose(np.linalg.norm(column["axis_u"], axis=1), 3 / 2_000**0.5, rtol=1e-5)


def test_usd_instancers_move_their_instances(stage, renderer):
    from pxr import Gf, UsdGeom

    instancer = UsdGeom.PointInstancer.Define(stage, "/many")
    usd_points(stage, "/many/ball", 400, 0.2)
    instancer.CreatePrototypesRel().AddTarget("/many/ball")
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    # USD takes velocities that have samples where positions have some.
    instancer.CreatePositionsAttr().Set([Gf.Vec3f(-1, 0, 0), Gf.Vec3f(0, 0, 0), Gf.Vec3f(1, 0, 0)], 1.0)
    instancer.CreateVelocitiesAttr().Set([Gf.Vec3f(0, 0, 0), Gf.Vec3f(0, 25, 0), Gf.Vec3f(0, 0, 0)], 1.0)
    instancer.CreateScalesAttr([Gf.Vec3f(1), Gf.Vec3f(1), Gf.Vec3f(2)])
    instancer.CreateInvisibleIdsAttr([0])
    stage.Save()
    scene = splatblur.io.usd.load(stage.GetRootLayer().realPath, time=1.0, size=(64, 48))
    assert [each.name for each in scene.objects] == ["/many[0]", "/many[1]"]
    assert scene.objects[0].model is scene.objects[1].model
    moving, large = scene.objects
    assert moving.pose_at(1.5, rate=25)[:3, 3] == pytest.approx([0, 0.5, 0], abs=1e-6)
    wanted = np.array([[2, 0, 0, 1], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1.0]])
    assert large.pose_at(1.5, rate=25) == pytest.approx(wanted)
    assert renderer.render(scene, 1, aovs="object").object.max() == 2


def test_usd_splats_are_captures(stage, renderer):
    usdvol = pytest.importorskip("pxr.UsdVol")
    if not hasattr(usdvol, "ParticleField3DGaussianSplat"):
        pytest.skip("this usd-core has no splats")
    from pxr import Gf, Vt

    rng = np.random.default_rng(3)
    n = 30
    means, scales = rng.normal(size=(n, 3)).astype("f4"), rng.uniform(0.05, 0.3, (n, 3)).astype("f4")
    quats, opacities = rng.normal(size=(n, 4)).astype("f4"), rng.uniform(0.2, 1, n).astype("f4")
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    sh = rng.normal(size=(n, 4, 3)).astype("f4")
    field = usdvol.ParticleField3DGaussianSplat.Define(stage, "/splats").GetPrim()
    field.GetAttribute("positions").Set(Vt.Vec3fArray.FromNumpy(means))
    field.GetAttribute("scales").Set(Vt.Vec3fArray.FromNumpy(scales))
    field.GetAttribute("opacities").Set(Vt.FloatArray.FromNumpy(opacities))
    field.GetAttribute("orientations").Set(Vt.QuatfArray([Gf.Quatf(*map(float, q)) for q in quats]))
    field.GetAttribute("radiance:sphericalHarmonicsDegree").Set(1)
    field.GetAttribute("radiance:sphericalHarmonicsCoefficients").Set(Vt.Vec3fArray.FromNumpy(sh.reshape(-1, 3)))
    stage.Save()
    scene = splatblur.io.usd.load(stage.GetRootLayer().realPath, size=(48, 36))
    wanted = sb.Scene(sb.Gaussians(means, quats, scales, opacities, sh=sh), size=(48, 36))
    a, b = (renderer.render(each).rgba for each in (scene, wanted))
    assert b.max() > 0.1 and np.array_equal(a, b)


def test_usd_files_that_cannot_be(stage, tmp_path):
    from pxr import UsdGeom

    with pytest.raises(sb.ModelError, match="a USD file"):
        (tmp_path / "b.usda").write_text("no stage")
        splatblur.io.usd.load(tmp_path / "b.usda")
    UsdGeom.Mesh.Define(stage, "/mesh")
    stage.Save()
    with pytest.warns(sb.NoteWarning, match="/mesh"), pytest.raises(sb.ModelError, match="nothing that is shown"):
        splatblur.io.usd.load(stage.GetRootLayer().realPath)


# --- VTK

def vtk_data():
    vtk = pytest.importorskip("vtkmodules.vtkCommonDataModel", reason="vtk is not installed")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints

    data, points = vtk.vtkPolyData(), vtkPoints()
    places = sphere(500)
    points.SetData(numpy_to_vtk(places, deep=True))
    data.SetPoints(points)
    columns = {"speed": places[:, 2], "velocity": np.tile([1.0, 2.0, 3.0], (500, 1)), "id": np.arange(500)}
    for name, values in columns.items():
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    return data, places


@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
def test_vtk_points_with_columns(tmp_path, mode):
    data, places = vtk_data()
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(tmp_path / "a.vtp"))
    writer.SetInputData(data)
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.Write()
    table = splatblur.io.vtk.read(tmp_path / "a.vtp")
    assert np.allclose(table.positions, places) and table.names == ["speed", "velocity", "id"] and len(table) == 500
    with pytest.warns(sb.NoteWarning):
        made = table.points(colour_by="speed", map="plasma", range=(-1, 1), velocities="velocity", ids="id")
    column = made._native.columns()
    order = column["id"]
    assert np.allclose(column["colour"], sb.colour_map(places[:, 2], "plasma", (-1, 1))[order], atol=1e-6)
    assert np.allclose(column["velocity"], [1, 2, 3])
    with pytest.raises(sb.InvalidValue, match="speed"):
        table.points(colour_by="pressure")


def test_vtk_legacy_grids_and_series(tmp_path):
    data, places = vtk_data()
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
    from vtkmodules.vtkIOLegacy import vtkPolyDataWriter
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkPolyDataWriter()
    writer.SetFileName(str(tmp_path / "a.vtk"))
    writer.SetInputData(data)
    writer.Write()
    assert np.allclose(splatblur.io.vtk.read(tmp_path / "a.vtk").positions, places, atol=1e-5)
    whole = (tmp_path / "a.vtk").read_bytes()
    (tmp_path / "cut.vtk").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(sb.ModelError, match="its reader"):
        splatblur.io.vtk.read(tmp_path / "cut.vtk")
    grid = vtkUnstructuredGrid()
    grid.SetPoints(data.GetPoints())
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(tmp_path / "a.vtu"))
    writer.SetInputData(grid)
    writer.Write()
    (tmp_path / "a.pvd").write_text(
        '<VTKFile type="Collection"><Collection><DataSet timestep="0.5" file="a.vtu"/>'
        '<DataSet timestep="0.25" file="a.vtk"/></Collection></VTKFile>'
    )
    assert splatblur.io.vtk.times(tmp_path / "a.pvd") == [0.25, 0.5]
    assert len(splatblur.io.vtk.read(tmp_path / "a.pvd", step=0).names) == 3
    assert splatblur.io.vtk.read(tmp_path / "a.pvd", step=1).names == []


def test_vtk_files_that_cannot_be(tmp_path):
    pytest.importorskip("vtkmodules", reason="vtk is not installed")
    for name, text in [("a.vtp", "<VTKFile"), ("a.vtk", "x"), ("a.pvd", "<a"), ("b.pvd", "<a/>"), ("a.vtu", "")]:
        (tmp_path / name).write_text(text)
        with pytest.raises(sb.ModelError):
            splatblur.io.vtk.read(tmp_path / name)
    with pytest.raises(sb.ModelError, match="no file"):
        splatblur.io.vtk.read(tmp_path / "none.vtp")


# --- HDF5

def test_hdf5_particles_of_gadget_and_of_openpmd(tmp_path):
    h5py = pytest.importorskip("h5py")
    places = sphere(300)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        gas = file.create_group("PartType0")
        gas["Coordinates"], gas["Density"] = places, places[:, 0]
        gas["Velocities"] = np.tile(np.float32([0, 1, 0]), (300, 1))
        electrons = file.create_group("data/0/particles/e")
        for axis, name in enumerate("xyz"):
            electrons[f"position/{name}"] = places[:, axis]
            electrons[f"position/{name}"].attrs["unitSI"] = 2.0
    table = splatblur.io.hdf5.read(tmp_path / "a.hdf5", "PartType0")
    assert set(table.names) == {"Coordinates", "Density", "Velocities"} and np.array_equal(table.positions, places)
    with pytest.warns(sb.NoteWarning):
        made = table.points(color_by="Density", velocities="Velocities")
    assert np.allclose(made._native.columns()["velocity"], [0, 1, 0])
    scaled = splatblur.io.hdf5.read(tmp_path / "a.hdf5", "data/0/particles/e")
    assert np.allclose(scaled.positions, 2 * places)
    for group, message in [("PartType9", "no group"), ("data", "positions")]:
        with pytest.raises(sb.ModelError, match=message):
            splatblur.io.hdf5.read(tmp_path / "a.hdf5", group)
    (tmp_path / "b.hdf5").write_bytes(b"\x89HDF\r\n\x1a\nxx")
    with pytest.raises(sb.ModelError, match="HDF5"):
        splatblur.io.hdf5.read(tmp_path / "b.hdf5")


# --- gsplat

def splats(n=50):
    rng = np.random.default_rng(2)
    return {
        "means": rng.normal(size=(n, 3)), "quats": rng.normal(size=(n, 4)), "scales": rng.normal(-2, 0.3, (n, 3)),
        "opacities": rng.normal(size=n), "sh0": rng.normal(size=(n, 1, 3)), "shN": rng.normal(size=(n, 8, 3)),
    }


def test_gsplat_checkpoints(tmp_path, renderer):
    given = splats()
    np.savez(tmp_path / "a.npz", **given)
    scales, opacities = np.exp(given["scales"]), 1 / (1 + np.exp(-given["opacities"]))
    sh = np.concatenate([given["sh0"], given["shN"]], axis=1)
    wanted = sb.Gaussians(given["means"], given["quats"], scales, opacities, sh=sh)._native.columns()
    for checkpoint in (given, {"step": 7, "splats": given}, tmp_path / "a.npz"):
        made = splatblur.io.gsplat.load(checkpoint)._native.columns()
        assert all(np.array_equal(made[name], wanted[name]) for name in wanted)
    for wrong in ({"splats": {}}, {"means": [1]}):
        with pytest.raises(sb.ModelError, match="sh0"):
            splatblur.io.gsplat.load(wrong)
    (tmp_path / "b.npz").write_bytes(b"PK no")
    with pytest.raises(sb.ModelError):
        splatblur.io.gsplat.load(tmp_path / "b.npz")


def test_gsplat_checkpoints_of_torch(tmp_path):
    torch = pytest.importorskip("torch")
    given = {key: torch.nn.Parameter(torch.tensor(value)) for key, value in splats().items()}
    torch.save({"step": 1, "splats": torch.nn.ParameterDict(given).state_dict()}, tmp_path / "a.pt")
    made = splatblur.io.gsplat.load(tmp_path / "a.pt")._native.columns()
    wanted = splatblur.io.gsplat.load(splats())._native.columns()
    assert all(np.allclose(made[name], wanted[name], atol=1e-6) for name in wanted)


# --- COLMAP and nerfstudio

def test_colmap_reconstructions(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    made = pycolmap.Reconstruction()
    camera = pycolmap.Camera(camera_id=1, model="PINHOLE", width=64, height=48, params=[60.0, 60.0, 31.0, 25.0])
    made.add_camera_with_trivial_rig(camera)
    rng = np.random.default_rng(1)
    poses = {}
    for number, name in [(1, "b10.png"), (2, "b9.png")]:
        quat = rng.normal(size=4)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(quat / np.linalg.norm(quat)), rng.normal(size=3))
        image = pycolmap.Image(image_id=number, name=name, camera_id=1)
        made.add_image_with_trivial_frame(image, pose)
        poses[name] = np.vstack([pose.matrix(), [0, 0, 0, 1]])
    for place, colour in [((1, 2, 3), (255, 0, 128)), ((4, 5, 6), (0, 255, 0))]:
        made.add_point3D(np.array(place, float), pycolmap.Track(), np.array(colour, np.uint8))
    for way in ("write_binary", "write_text"):
        folder = tmp_path / way / "sparse" / "0"
        folder.mkdir(parents=True)
        getattr(made, way)(str(folder))
        views = splatblur.io.colmap.views(tmp_path / way)
        assert views.names == ["b9.png", "b10.png"] and views.sizes == [(64, 48)] * 2 and views.distorted == []
        for name, c2w in zip(views.names, views.c2w, strict=True):
            # OpenCV to OpenGL axes.
            assert np.linalg.inv(c2w @ np.diag([1.0, -1, -1, 1])) == pytest.approx(poses[name], abs=1e-9)
        assert views.camera().K == pytest.approx(np.array([[60, 0, 31], [0, 60, 25], [0, 0, 1.0]]))
        assert views.camera(size=(32, 24)).K == pytest.approx(np.array([[30, 0, 15.5], [0, 30, 12.5], [0, 0, 1.0]]))
        assert len(views.cameras()) == 2
        with pytest.warns(sb.NoteWarning):
            points = splatblur.io.colmap.points(tmp_path / way)
        assert len(points) == 2 and points.bounds == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]))
    images = tmp_path / "write_text" / "sparse" / "0" / "images.txt"
    images.write_text("# poses, and points\n1 1 0 0 0 0 0 0 1 a.png\n1 2 -1 3 4 -1\n2 1 0 0 0 1 0 0 1 b c.png\n\n")
    assert splatblur.io.colmap.views(tmp_path / "write_text").names == ["a.png", "b c.png"]
    whole = (tmp_path / "write_binary" / "sparse" / "0" / "images.bin").read_bytes()
    for cut in range(0, len(whole), 7):
        (tmp_path / "write_binary" / "sparse" / "0" / "images.bin").write_bytes(whole[:cut])
        with pytest.raises(sb.ModelError):
            splatblur.io.colmap.views(tmp_path / "write_binary")
    (tmp_path / "write_text" / "sparse" / "0" / "cameras.txt").write_text("1 PINHOLE 64 x 60 60 31 25\n")
    with pytest.raises(sb.ModelError) as refused:
        splatblur.io.colmap.views(tmp_path / "write_text")
    assert refused.value.line == 1 and refused.value.file


def test_nerfstudio_is_what_the_program_writes(tmp_path, program, renderer):
    line = [program, "dataset", str(SCENES / "guitar_flight.xml"), "--frames", "8..12", "--size", "48x36", "--no-flow",
            "--mode", "supersample:2", "--out", str(tmp_path), "--quiet", "--backend", "cpu"]
    subprocess.run(line, check=True, timeout=300)
    views = splatblur.io.nerfstudio.views(tmp_path)
    assert len(views) == 5 and views.names[0].endswith("0008.png")
    own = sb.load(SCENES / "guitar_flight.xml", size=(48, 36))
    for number, c2w in zip(range(8, 13), views.c2w, strict=True):
        assert own.camera_to_world(number) == pytest.approx(c2w, abs=1e-9)
    own.camera = views.camera(times=range(8, 13))
    assert renderer.render(own, 10).rgba.max() > 0.05
    text = json.loads((tmp_path / "transforms.json").read_text())
    for change in [{"frames": 1}, {"w": "x"}, {"fl_x": None, "fl_y": None}, {"frames": [{}]}, {"frames": [1]}]:
        (tmp_path / "b.json").write_text(json.dumps({**text, **change}))
        with pytest.raises(sb.ModelError):
            splatblur.io.nerfstudio.views(tmp_path / "b.json")
    (tmp_path / "b.json").write_text("{")
    with pytest.raises(sb.ModelError, match="JSON"):
        splatblur.io.nerfstudio.views(tmp_path / "b.json")
    with pytest.raises(sb.ModelError, match="transforms.json"):
        splatblur.io.nerfstudio.views(os.path.join(tmp_path, "none"))


def test_adapters_take_any_model_along(renderer):
    """A ball beside a capture's cameras: the adapters' results are those of the package."""
    K = np.array([[[60.0, 0, 32], [0, 60, 24], [0, 0, 1]]])
    views = splatblur.io.Views(["a"], np.eye(4)[None], K, [(64, 48)], [])
    far = np.eye(4)
    far[2, 3] = -5
    frame = renderer.render(sb.Scene(sb.Object(ball(), transform=far), camera=views.camera()), aovs="alpha")
    assert middle(frame) == pytest.approx([32, 24], abs=0.3)


def test_speed_is_the_length_of_velocities_and_wrong_files_are_named(tmp_path):
    h5py = pytest.importorskip("h5py")
    rng = np.random.default_rng(3)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"], file["y"], file["z"] = rng.normal(size=(3, 20))
        file["v"] = rng.normal(size=(20, 3))
    table = sb.io.hdf5.read(tmp_path / "a.h5")
    by_speed = table.points(colour_by="speed", velocities="v")._native.columns()["colour"]
    assert np.array_equal(by_speed, table.points(colour_by="v")._native.columns()["colour"])
    (tmp_path / "b.png").write_bytes(b"no such thing")
    with pytest.raises(sb.ModelError, match="no HDF5 file"):
        sb.io.hdf5.read(tmp_path / "b.png")
    pytest.importorskip("vtk")
    with pytest.raises(sb.ModelError, match="extension"):
        sb.io.vtk.read(tmp_path / "b.png")
