"""Makes the picture pairs of this folder and their metrics, by programs that splatblur does not use.

    pip install flip-evaluator==1.7 scikit-image==0.26.0 numpy==2.4.6 pillow==13.0.0 OpenEXR==3.5.3
    python make.py

FLIP: flip-evaluator (the authors' C++), which takes display values; SSIM, PSNR: scikit-image; the rest: numpy, float64.
Read back from the files as stored, so that only the files and `expected.json` matter.
"""

import json
import math

import flip_evaluator
import numpy as np
import OpenEXR
from PIL import Image
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

PPD = 3840 * math.pi / 180
rng = np.random.default_rng(6)


def save_png(name, display):
    Image.fromarray((np.clip(display, 0, 1) * 255).round().astype(np.uint8)).save(f"{name}.png", optimize=True)


def save_exr(name, linear):
    planes = {"RGBA": np.ascontiguousarray(linear.astype(np.float32))}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(f"{name}.exr")


def to_linear(e):
    return np.where(e <= 0.04045, e / 12.92, ((e + 0.055) / 1.055) ** 2.4)


def to_display(linear):
    v = np.clip(linear, 0, 1)
    return np.where(v <= 0.0031308, v * 12.92, 1.055 * v ** (1 / 2.4) - 0.055)


# A part of a rendering, which is kept as it is, against itself one pixel off and a little blurred.
crop = np.asarray(Image.open("render_b.png").convert("RGB")) / 255.0
moved = (np.roll(crop, 1, axis=1) + crop + np.roll(crop, 1, axis=0)) / 3
save_png("render_a", moved)
save_png("render_b", crop)

# Saturated patches and gradients with noise; an odd size.
y, x = np.mgrid[0:75, 0:101]
patches = rng.random((5, 7, 3))[y // 15, x // 15]
patches[:, 50:, :] *= (x[:, 50:, None] - 50) / 50
save_png("patches_a", patches + rng.normal(0, 0.06, patches.shape))
save_png("patches_b", patches)

# Stripes of rising frequency, against less contrast and another hue.
phase = np.cumsum(0.05 + 0.02 * np.arange(120))
stripes = np.repeat((0.5 + 0.5 * np.sin(phase))[None, :, None], 64, axis=0) * np.array([1.0, 0.9, 0.7])
faded = stripes * np.linspace(1, 0.4, 64)[:, None, None] + 0.1
save_png("stripes_a", faded)
save_png("stripes_b", stripes)

# Linear light below 0 and above 1, with alpha.
h, w = 23, 37
b = rng.normal(0.4, 0.6, (h, w, 4))
b[..., 3] = rng.random((h, w))
a = b + rng.normal(0.01, 0.05, b.shape)
save_exr("linear_a", a)
save_exr("linear_b", b)


def load(name):
    """Linear premultiplied RGBA as stored, and display RGB."""
    if name.startswith("linear"):
        linear = OpenEXR.File(f"{name}.exr").channels()["RGBA"].pixels.astype(np.float64)
        return linear, to_display(linear[..., :3])
    display = np.asarray(Image.open(f"{name}.png")) / 255.0
    return np.dstack([to_linear(display), np.ones(display.shape[:2])]), display


expected = {}
for pair in ["render", "patches", "stripes", "linear"]:
    (la, da), (lb, db) = load(f"{pair}_a"), load(f"{pair}_b")
    d, alpha = (la - lb)[..., :3], (la - lb)[..., 3]
    worst = np.unravel_index(np.argmax(np.abs(d).max(axis=2)), d.shape[:2])
    flip_map, flip_mean, _ = flip_evaluator.evaluate(
        db.astype(np.float32), da.astype(np.float32), "LDR", inputsRGB=True, applyMagma=False, parameters={"ppd": PPD}
    )
    flip_map = np.asarray(flip_map, dtype=np.float64).reshape(da.shape[0], da.shape[1], -1)[..., 0]
    expected[pair] = {
        "mse": (d**2).mean(),
        "rmse": math.sqrt((d**2).mean()),
        "relmse": (d**2 / (lb[..., :3] ** 2 + 0.01)).mean(),
        "mae": np.abs(d).mean(),
        "bias": np.abs(d.mean(axis=(0, 1))).max(),
        "bias_rgb": d.mean(axis=(0, 1)).tolist(),
        "worst": np.abs(d).max(),
        "worst_xy": [int(worst[1]), int(worst[0])],
        "gamma-rmse": math.sqrt(((da - db) ** 2).mean()),
        "psnr": peak_signal_noise_ratio(db, da, data_range=1.0),
        "ssim": structural_similarity(
            da, db, data_range=1.0, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        ),
        "flip": flip_map.mean(),
        "flip_stated": flip_mean,
        "flip_row": flip_map[da.shape[0] // 2].tolist(),
        "alpha-rmse": math.sqrt((alpha**2).mean()),
        "alpha-mae": np.abs(alpha).mean(),
        "alpha-bias": abs(alpha.mean()),
        "alpha-worst": np.abs(alpha).max(),
    }
json.dump(expected, open("expected.json", "w"), indent=1)
