"""What the tests share."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import splatblur as sb

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"


def within(seconds: float, limit: float) -> None:
    """Holds a time to its limit where SPLATBLUR_SPEED=1 is set: times of a busy machine say little."""
    if os.environ.get("SPLATBLUR_SPEED"):
        assert seconds < limit, f"{seconds:.3f} s"


def sphere(count: int = 2_000, radius: float = 1.0) -> np.ndarray:
    """Points on a sphere, on a spiral."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - 5.0**0.5) * np.arange(count)
    around = np.sqrt(1.0 - z * z)
    return radius * np.stack([np.cos(angle) * around, np.sin(angle) * around, z], axis=1)


def ball(count: int = 2_000, **columns: object) -> sb.Points:
    """A grey ball of radius 1."""
    points = sphere(count)
    given = {"normals": points, "radii": np.full(count, 3.0 / count**0.5), "colors": np.full((count, 3), 0.5)}
    return sb.Points(points, **{**given, **columns})


def front(width: int = 64, height: int = 48) -> sb.Camera:
    """A camera five units before the origin."""
    return sb.Camera(width, height, fovy=40, eye=(0, 0, 5), at=(0, 0, 0))


@pytest.fixture(scope="session")
def renderer() -> sb.Renderer:
    return sb.Renderer("cpu")


@pytest.fixture
def program() -> str:
    """The program that the wheel installed."""
    return os.path.join(os.path.dirname(sys.executable), "splatblur")
