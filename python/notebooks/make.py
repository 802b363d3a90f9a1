"""Writes the two notebooks. Their cells stand here, where they can be read and compared line by line."""

from __future__ import annotations

import json
import os
import re
import sys

PAIRS = '''
# # A capture with camera shake, to 50 pairs for deblurring
#
# The guitar that ships with splatblur is a capture of 3D Gaussians. A hand-held camera shakes while the shutter is
# open. A `Dataset` renders blurred and sharp pictures of it, and we check that the mean of the sharp ones is the
# blurred one.

import os
import numpy as np
import splatblur as sb

ROOT = os.environ.get("SPLATBLUR_ROOT", "../..")
PAIRS = int(os.environ.get("SPLATBLUR_PAIRS", "50"))
guitar = sb.Gaussians.load(f"{ROOT}/scenes/models/guitar.compressed.ply")
guitar

# A shake: a few sines with random phases, in position and in direction. Captures have y down, so the camera has, too.

def shaken(number):
    rng = np.random.default_rng(int(number))
    times = np.linspace(number - 0.5, number + 0.5, 33)
    waves = lambda: sum(rng.normal() * np.sin(2 * np.pi * (f * times + rng.uniform())) for f in (0.7, 1.9, 3.1))
    angle = rng.uniform(0, 2 * np.pi)
    low, high = guitar.bounds
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    eye = middle + size * np.array([np.sin(angle), -0.15, np.cos(angle)])
    poses = np.zeros((33, 4, 4))
    shifts = 0.004 * size * np.stack([waves(), waves(), waves()], axis=1)
    turns = 0.004 * size * np.stack([waves(), waves(), waves()], axis=1)
    for pose, shift, turn in zip(poses, shifts, turns):
        back = eye + shift - (middle + turn)
        back /= np.linalg.norm(back)
        right = np.cross([0, -1, 0], back)
        right /= np.linalg.norm(right)
        pose[:3] = np.stack([right, np.cross(back, right), back, eye + shift], axis=1)
        pose[3, 3] = 1
    camera = sb.Camera(80, 60, fovy=40, c2w=poses, times=times)
    return sb.Scene(guitar, camera=camera, shutter=sb.Shutter(-0.4, 0.4), background=0.2)

# Fifty pairs, with 9 sharp pictures each; they are rendered when they are asked for.

mode = "auto:good+interleave=none"
data = sb.Dataset(shaken, frames=range(PAIRS), sharp=9, flow=False, channels="last", mode=mode)
len(data)

# The mean of the sharp pictures, with their weights, is the blurred picture within the error that mode auto states for
# it. 19 of 20 pictures stay within that, so of fifty pairs a few may be a little beyond it.

errors, stated = [], []
for pair in data:
    mean = np.tensordot(pair["sharp_weights"], pair["sharp"].astype(float), axes=1)
    difference = sb.linear_to_srgb(mean) - sb.linear_to_srgb(pair["blurred"])
    errors.append(np.sqrt(np.mean(difference**2)))
    stated.append(pair["stated_error"])
errors, stated = np.array(errors), np.array(stated)
within = np.mean(errors <= stated)
print(f"{len(errors)} pairs: difference {np.mean(errors):.4f}, stated {np.mean(stated):.4f}; {within:.0%} are within")
assert len(errors) == PAIRS and within >= 0.9 and np.mean(errors**2) < np.mean(stated**2)

# One pair, as a picture: blurred on the left, the middle of the shutter on the right.

pair = data[0]
sb.Frame(np.concatenate([pair["blurred"], pair["sharp"][4]], axis=1))
'''

MODES = '''
# # How wrong are modes?
#
# Each mode renders the same frame of the scene `crossing`; the ray-traced reference says how far each is from
# the truth.

import os
import matplotlib
matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import splatblur as sb

ROOT = os.environ.get("SPLATBLUR_ROOT", "../..")
scene = sb.load(f"{ROOT}/scenes/crossing.xml", size=(240, 135))
renderer = sb.Renderer("cpu")
truth = renderer.reference(scene, 12, samples=256)
truth

# FLIP and seconds of some modes. The reference has a standard error of its own, which bounds what can be seen.

modes = [f"supersample:{n}" for n in (2, 4, 8, 16, 32)] + [f"bucket:{n}x4" for n in (2, 4)]
modes += ["volumetric:3", "auto:draft", "auto:good", "auto:final"]
found = {}
for mode in modes:
    frame = renderer.render(scene, 12, mode=mode)
    found[mode] = sb.compare(frame, truth, ("flip", "psnr"))["flip"], frame.stats["seconds"]
    print(f"{mode:16} FLIP {found[mode][0]:.4f}  {found[mode][1]:.2f} s")
assert found["supersample:32"][0] < found["supersample:8"][0] < found["supersample:2"][0]
print(f"standard error of the reference: {truth.stats['stated_error']:.4f}")

# The plot: down and to the left is better.

figure, axes = plt.subplots(figsize=(7, 4.5))
for mode, (flip, seconds) in found.items():
    axes.plot(seconds, flip, "o")
    axes.annotate(mode, (seconds, flip), textcoords="offset points", xytext=(5, 4), fontsize=8)
axes.set(xscale="log", yscale="log", xlabel="seconds", ylabel="FLIP against the reference")
figure.tight_layout()
figure
'''


def cells(text: str) -> list[dict[str, object]]:
    """Paragraphs of comments are text; all else is code, in one cell up to the next text."""
    made: list[dict[str, object]] = []
    for part in re.split(r"\n\n(?=# )|(?<=\n)\n(?=# )", text.strip()):
        lines = part.split("\n")
        count = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
        prose = "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines[:count])
        code = "\n".join(lines[count:]).strip()
        made.append({"cell_type": "markdown", "metadata": {}, "source": prose, "id": f"text-{len(made)}"})
        if code:
            code_cell = {"cell_type": "code", "metadata": {}, "source": code, "id": f"code-{len(made)}"}
            made.append({**code_cell, "execution_count": None, "outputs": []})
    return made


def notebook(text: str) -> str:
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells(text), "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    for name, text in (("pairs", PAIRS), ("modes", MODES)):
        with open(os.path.join(folder, f"{name}.ipynb"), "w", encoding="utf-8") as file:
            file.write(notebook(text))
