"""The program of the wheel, and the same bytes from both."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from conftest import ROOT, SCENES, within

import splatblur as sb

NAMES = sorted(path.stem for path in SCENES.glob("*.xml"))


def run(program: str, *arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, **options)


def test_the_program_is_on_the_path(program, tmp_path):
    version = run(program, "--version")
    assert (version.returncode, version.stdout) == (0, f"splatblur {sb.__version__}\n")
    assert run(sys.executable, "-m", "splatblur", "--version").stdout == version.stdout
    assert run(program).returncode == 2 and run(program, "render", "none.xml").returncode == 2
    assert "none.xml" in run(program, "render", "none.xml").stderr
    made = tmp_path / "sphere.ply"
    assert run(program, "generate", "sphere", made, "--surfels", 1000).returncode == 0
    # 1: a comparison is over its limit.
    for number, mode in [(0, "still"), (1, "still:4")]:
        out = tmp_path / str(number)
        assert run(program, "render", made, "--size", "32x24", "--mode", mode, "--out", out).returncode == 0
    a, b = (next((tmp_path / number).glob("*.png")) for number in "01")
    assert run(program, "compare", a, b, "--limit", "rmse=1e-9").returncode == 1


def test_ctrl_c_ends_the_program_with_130(program, tmp_path):
    line = [program, "render", str(SCENES / "three_objects.xml"), "--out", str(tmp_path), "--mode", "supersample:512"]
    child = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    assert child.stderr is not None
    # Its first line says what is rendered: it watches for Ctrl-C soon after.
    child.stderr.readline()
    time.sleep(1.0)
    start = time.perf_counter()
    child.send_signal(signal.SIGINT)
    _, rest = child.communicate(timeout=20)
    assert child.returncode == 130 and "interrupted" in rest
    within(time.perf_counter() - start, 1.0)


def test_versions_agree():
    text = (ROOT / "Cargo.toml").read_text()
    assert f'version = "{sb.__version__}"' in text


@pytest.mark.parametrize("name", NAMES)
def test_the_bytes_are_those_of_the_program(name, program, tmp_path, renderer):
    """Every scene that ships, its first frame and one of the middle (`SPLATBLUR_QUICK`: that alone): headers and all."""
    scene = sb.load(SCENES / f"{name}.xml", size=(96, 54))
    numbers = sorted({scene.frames[0], scene.frames[len(scene.frames) // 2]})
    numbers = numbers[-1:] if os.environ.get("SPLATBLUR_QUICK") else numbers
    listed = ",".join(map(str, numbers))
    shared = ["--frames", listed, "--size", "96x54", "--backend", "cpu", "--quiet"]
    # Both read the scene by the same path, which headers hold by its name alone.
    done = run(program, "render", SCENES / f"{name}.xml", *shared, "--out", tmp_path / "png")
    assert done.returncode == 0, done.stderr
    layers = ["--format", "exr", "--aov", "alpha,depth,velocity,object"]
    done = run(program, "render", SCENES / f"{name}.xml", *shared, *layers, "--out", tmp_path / "exr")
    assert done.returncode == 0, done.stderr
    for frame in renderer.frames(scene, numbers):
        file = f"{name}.{frame.number:04.0f}.png"
        frame.save(tmp_path / file)
        assert (tmp_path / file).read_bytes() == (tmp_path / "png" / file).read_bytes(), file
    for frame in renderer.frames(scene, numbers, aovs=["alpha", "depth", "velocity", "object"]):
        file = f"{name}.{frame.number:04.0f}.exr"
        frame.save(tmp_path / file)
        assert (tmp_path / file).read_bytes() == (tmp_path / "exr" / file).read_bytes(), file


def test_a_reference_has_the_bytes_of_the_program(program, tmp_path, renderer):
    name = "crossing"
    line = ["reference", SCENES / f"{name}.xml", "--frames", "12", "--size", "48x27", "--samples", "64"]
    done = run(program, *line, "--out", tmp_path / "program", "--format", "exr")
    assert done.returncode == 0, done.stderr
    renderer.reference(sb.load(SCENES / f"{name}.xml", size=(48, 27)), 12, samples=64).save(tmp_path / "python.exr")
    (written,) = (tmp_path / "program").rglob("*.exr")
    assert (tmp_path / "python.exr").read_bytes() == written.read_bytes()


def test_the_wheel_is_small():
    package = os.path.dirname(sb.__file__)
    size = sum(os.path.getsize(os.path.join(folder, file)) for folder, _, files in os.walk(package) for file in files)
    # Unpacked; python/run looks at the wheel itself, which has to be under 25 MB.
    assert size < 60 << 20
