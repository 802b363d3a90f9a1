"""The guide, the docstrings and the notebooks."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT

import splatblur as sb

NOTEBOOKS = ROOT / "python" / "notebooks"


def test_the_guide_runs(tmp_path, monkeypatch):
    """All code of docs/python.md, one block after the other; what needs torch, where torch is."""
    text = (ROOT / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(blocks) == 5
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        # A look, instead of hours.
        block = block.replace("samples=1024", "samples=64").replace("480, 270", "64, 36")
        block = block.replace("range(1000)", "range(4)")
        if "torch" in block:
            torch = pytest.importorskip("torch") if "torch" in sys.modules or _has("torch") else None
            if torch is None:
                continue
            names |= {"torch": torch, "net": torch.nn.Conv2d(3, 3, 1), "criterion": torch.nn.L1Loss()}
        exec(compile(block, "docs/python.md", "exec"), names)
    assert (tmp_path / "crossing.png").exists() and len(names["data"]) == 200
    assert names["data"][7]["blurred"].shape == (3, 36, 64)


def _has(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec(name) is not None


def test_glue_for_pairs_with_shakes_is_short():
    text = (ROOT / "docs" / "python.md").read_text()
    block = next(block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "def shaken" in block)
    assert len([line for line in block.splitlines() if line.strip()]) <= 15


def test_every_public_name_says_what_it_is():
    for name in sb.__all__:
        thing = getattr(sb, name)
        if name == "__version__":
            continue
        assert thing.__doc__, name
        if isinstance(thing, type):
            for member, value in vars(thing).items():
                if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                    assert value.__doc__ or getattr(value, "__wrapped__", None), f"{name}.{member}"


def test_pdoc_renders_without_a_warning(tmp_path):
    pytest.importorskip("pdoc")
    line = [sys.executable, "-W", "error", "-m", "pdoc", "splatblur", "--docformat", "google", "-o", str(tmp_path)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and not re.search(r"[Ww]arn", done.stderr), done.stderr
    assert (tmp_path / "splatblur.html").stat().st_size > 50_000


def test_notebooks_are_those_of_their_script(tmp_path):
    subprocess.run([sys.executable, NOTEBOOKS / "make.py", tmp_path], check=True)
    for name in ("pairs", "modes"):
        assert (tmp_path / f"{name}.ipynb").read_text() == (NOTEBOOKS / f"{name}.ipynb").read_text(), name


@pytest.mark.parametrize("name", ["pairs", "modes"])
@pytest.mark.filterwarnings("ignore")
def test_notebooks_run(name, monkeypatch):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("SPLATBLUR_ROOT", str(ROOT))
    book = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
    nbclient.NotebookClient(book, timeout=1800, kernel_name="python3").execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output.output_type == "error" for output in outputs)
    assert os.environ["SPLATBLUR_ROOT"] == str(ROOT)
