"""Renders moving points, captures and meshes with motion blur: arrays in, blurred arrays out.

```python
import numpy as np, splatblur as sb

p = np.random.default_rng(0).normal(size=(20_000, 3))
p /= np.linalg.norm(p, axis=1, keepdims=True)
ball = sb.Points(p, normals=p, colors=(p + 1) / 2, velocities=[9.0, 0, 0])
scene = sb.Scene([ball], camera=sb.Camera(640, 480, fovy=40, eye=(0, 0, 5), at=(0, 0, 0)))
frame = sb.render(scene, aovs=["depth", "velocity"])
frame.rgba, frame.depth, frame.stats["stated_error"]
```

The guide is docs/python.md. Conventions: right-handed axes; images begin at the top row; colours are linear Rec.709,
premultiplied by alpha; times are frames, and the shutter is given in frames around the frame number; angles are
degrees.
A camera's keyword is its convention: `viewmat` (OpenCV, world to camera) or `c2w` (OpenGL, camera to world).
"""

from ._camera import Camera, Environment, Light, Shutter
from ._colour import color_map, colour_map
from ._dataset import Dataset
from ._errors import (
    ForkError,
    ImageError,
    InvalidValue,
    ModelError,
    NoteWarning,
    RenderError,
    SceneError,
    SplatblurError,
)
from ._frame import Frame, compare, linear_to_srgb, read, srgb_to_linear
from ._native import __version__
from ._objects import Gaussians, Model, Object, Points
from ._render import Frames, Renderer, render
from ._scene import Scene, load, save
from . import io  # isort: skip

__all__ = [
    "Camera",
    "Dataset",
    "Environment",
    "ForkError",
    "Frame",
    "Frames",
    "Gaussians",
    "ImageError",
    "InvalidValue",
    "Light",
    "Model",
    "ModelError",
    "NoteWarning",
    "Object",
    "Points",
    "RenderError",
    "Renderer",
    "Scene",
    "SceneError",
    "Shutter",
    "SplatblurError",
    "__version__",
    "color_map",
    "colour_map",
    "compare",
    "io",
    "linear_to_srgb",
    "load",
    "read",
    "render",
    "save",
    "srgb_to_linear",
]
