"""Renders one scene of direct light with splatblur and with Cycles, and compares the linear pictures.

    pip install bpy==4.2.0 numpy==2.4.6 OpenEXR==3.5.3    # Python 3.11
    python against_cycles.py SPLATBLUR FOLDER [--size 480x270] [--mode supersample:256] [--samples 1024]

SPLATBLUR is the program, FOLDER is where scene, models and pictures go. Blender's file and Cycles' picture are kept
there. The scene: a floor, a ball at rest that touches it, a ball that flies, a box that spins, and a plate above the
picture; a sun of 2 degrees; no other light and no bounces. Both programs get the same triangles and normals.

Regions come from rays that numpy traces through the ideal shapes, and from Cycles' brightness of the floor.
"""

import argparse
import contextlib
import math
import os
import struct
import subprocess
import time
import zlib

import bpy
import numpy as np
import OpenEXR
from mathutils import Matrix, Vector

SUN = {"direction": (-0.55, -1.0, -0.5), "angle": 2.0}
SHUTTER = (-0.25, 0.25)
# Cycles' shutter is a table of 256 times, and it leaves out a part of both ends: entry i is (i + 1/2) 255 / 256^2
# (util/math_cdf.cpp), and random numbers from 0 to 1 choose between entries 0 and 255 (kernel/util/lookup_table.h).
# splatblur gets what is left.
EXPOSED = tuple(SHUTTER[0] + (SHUTTER[1] - SHUTTER[0]) * (entry + 0.5) * 255 / 256**2 for entry in (0, 255))
CAMERA = {"eye": (0.3, 3.2, 5.6), "at": (0.1, 0.55, 0.1), "fovy": 34.0}
# Frame 0 is rendered, and nothing has moved there. Motion is in units and degrees a frame, about the object's +z.
SHAPES = [
    {"name": "floor", "kind": "plane", "half": (7.0, 7.0), "place": (0.0, 0.0, 0.0), "colour": (0.75, 0.72, 0.66)},
    {"name": "resting", "kind": "ball", "radius": 0.6, "place": (-1.2, 0.6, -0.4), "colour": (0.8, 0.15, 0.1)},
    {
        "name": "flying",
        "kind": "ball",
        "radius": 0.4,
        "place": (0.3, 1.0, 0.7),
        "colour": (0.15, 0.6, 0.2),
        "velocity": (1.8, 0.5, -0.6),
    },
    {
        "name": "spinning",
        "kind": "box",
        "half": (0.7, 0.22, 0.22),
        "place": (1.75, 0.75, -0.5),
        "colour": (0.2, 0.35, 0.85),
        "turn": 60.0,
    },
    {"name": "plate", "kind": "box", "half": (0.5, 0.03, 0.8), "place": (0.9, 3.6, 3.1), "colour": (0.5, 0.5, 0.5)},
]


def ball(radius):
    """A cube of 96 x 96 squares on each face, on the ball: vertices, their normals, triangles."""
    n = 96
    grid = np.tan(np.linspace(-1, 1, n + 1) * math.pi / 4)
    u, v = (a.ravel() for a in np.meshgrid(grid, grid, indexing="ij"))
    points, triangles = [], []
    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :n].ravel()
    for axis in range(3):
        for sign in (1, -1):
            face = np.empty((u.size, 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = sign, u * sign, v
            a, b, c, d = (corner + step + len(points) * u.size for step in (0, n + 1, n + 2, 1))
            points.append(face)
            triangles += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    normals = np.concatenate(points)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals, merged = np.unique(normals.round(12), axis=0, return_inverse=True)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals * radius, normals, merged.ravel()[np.concatenate(triangles)]


def box(half):
    """Six faces with normals of their own."""
    points, normals, triangles = [], [], []
    for axis in range(3):
        for sign in (1, -1):
            start = len(points)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                point, normal = np.empty(3), np.zeros(3)
                point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3] = sign, u * sign, v
                normal[axis] = sign
                points.append(point * half)
                normals.append(normal)
            triangles += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return np.array(points), np.array(normals), np.array(triangles)


def plane(half):
    points = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)]) * np.array((half[0], 0, half[1]))
    return points, np.tile((0.0, 1.0, 0.0), (4, 1)), np.array([(0, 1, 2), (0, 2, 3)])


def mesh(shape):
    if shape["kind"] == "ball":
        return ball(shape["radius"])
    return box(shape["half"]) if shape["kind"] == "box" else plane(shape["half"])


def numbers(values):
    return " ".join(f"{value:g}" for value in values)


# splatblur


def write_scene(folder, size):
    """PLY files with linear colours, and the scene file."""
    objects = []
    for shape in SHAPES:
        points, normals, triangles = mesh(shape)
        rows = np.hstack([points, normals, np.tile(shape["colour"], (len(points), 1))]).astype("<f4")
        faces = np.empty(len(triangles), dtype=[("n", "u1"), ("i", "<i4", 3)])
        faces["n"], faces["i"] = 3, triangles
        names = "x y z nx ny nz red green blue".split()
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
        header += [f"property float {name}" for name in names]
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
        with open(f"{folder}/{shape['name']}.ply", "wb") as file:
            file.write("\n".join(header).encode() + rows.tobytes() + faces.tobytes())
        motion = ""
        if "velocity" in shape:
            motion = f'\n    <motion type="linear" velocity="{numbers(shape["velocity"])}"/>'
        if "turn" in shape:
            motion = f'\n    <motion type="rotation" axis="0 0 1" degreesPerFrame="{shape["turn"]:g}"/>'
        objects.append(f"""  <object name="{shape["name"]}">
    <pointModel colourSpace="linear">{shape["name"]}.ply</pointModel>{motion}
    <place translate="{numbers(shape["place"])}"/>
    <material ambient="0" diffuse="1" specular="0"/>
  </object>
""")
    with open(f"{folder}/scene.xml", "w") as file:
        file.write(f"""<scene>
  <image width="{size[0]}" height="{size[1]}"/>
  <frames first="0" last="0"/>
  <shutter open="{EXPOSED[0]:.9g}" close="{EXPOSED[1]:.9g}"/>
  <camera eye="{numbers(CAMERA["eye"])}" at="{numbers(CAMERA["at"])}" fovy="{CAMERA["fovy"]:g}"/>
  <light type="directional" direction="{numbers(SUN["direction"])}" shadows="true" angle="{SUN["angle"]:g}"/>
{"".join(objects)}</scene>
""")


# Cycles


def look(forward, up):
    """Axes of a thing of Blender's that looks along its -z with +y up."""
    back = -Vector(forward).normalized()
    right = Vector(up).cross(back).normalized()
    return Matrix((right, back.cross(right), back)).transposed().to_4x4()


def build(size, samples, threads, seed):
    """The same scene in Blender, in splatblur's axes: nothing in Cycles asks which way is up."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    link = scene.collection.objects.link
    for shape in SHAPES:
        points, normals, triangles = mesh(shape)
        data = bpy.data.meshes.new(shape["name"])
        data.from_pydata(points.tolist(), [], triangles.tolist())
        data.polygons.foreach_set("use_smooth", [True] * len(triangles))
        data.normals_split_custom_set_from_vertices(normals.tolist())
        material = bpy.data.materials.new(shape["name"])
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
        diffuse.inputs["Color"].default_value = (*shape["colour"], 1)
        diffuse.inputs["Roughness"].default_value = 0
        material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
        data.materials.append(material)
        thing = bpy.data.objects.new(shape["name"], data)
        thing.location = shape["place"]
        link(thing)
        # Cycles moves shadows' edges on smooth meshes unless both are 0. These are fine enough without.
        thing.cycles.shadow_terminator_offset = 0
        thing.cycles.shadow_terminator_geometry_offset = 0
        thing.cycles.use_motion_blur = True
        thing.cycles.motion_steps = 5
        for frame in (-1, 1):
            if "velocity" in shape:
                thing.location = Vector(shape["place"]) + frame * Vector(shape["velocity"])
                thing.keyframe_insert("location", frame=frame)
            if "turn" in shape:
                thing.rotation_euler = (0, 0, frame * math.radians(shape["turn"]))
                thing.keyframe_insert("rotation_euler", frame=frame)
        if thing.animation_data:
            for curve in thing.animation_data.action.fcurves:
                for key in curve.keyframe_points:
                    key.interpolation = "LINEAR"

    sun = bpy.data.lights.new("sun", "SUN")
    # An irradiance of pi: a white Lambert surface that faces the sun has radiance 1, as in splatblur.
    sun.energy = math.pi
    sun.angle = math.radians(SUN["angle"])
    thing = bpy.data.objects.new("sun", sun)
    thing.matrix_world = look(SUN["direction"], (0, 1, 0))
    link(thing)

    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "VERTICAL"
    camera.sensor_height = 24
    camera.lens = 12 / math.tan(math.radians(CAMERA["fovy"]) / 2)
    camera.clip_start = 0.01
    thing = bpy.data.objects.new("camera", camera)
    forward = Vector(CAMERA["at"]) - Vector(CAMERA["eye"])
    thing.matrix_world = Matrix.Translation(CAMERA["eye"]) @ look(forward, (0, 1, 0))
    link(thing)
    scene.camera = thing

    scene.world = bpy.data.worlds.new("black")
    scene.world.color = (0, 0, 0)
    scene.frame_set(0)
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", threads
    render.use_motion_blur = True
    render.motion_blur_position = "CENTER"
    render.motion_blur_shutter = SHUTTER[1] - SHUTTER[0]
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.color_mode = "RGB"
    scene.view_settings.view_transform = "Standard"
    cycles.device = "CPU"
    cycles.samples, cycles.seed = samples, seed
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0
    return scene


@contextlib.contextmanager
def quiet(path):
    """Blender's many lines go to a file."""
    before = os.dup(1)
    with open(path, "wb") as file:
        os.dup2(file.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(before, 1)
            os.close(before)


# Pictures


def read(path, size):
    """Linear red, green and blue, row 0 at the top."""
    channels = OpenEXR.File(path).channels()
    picture = channels["RGBA"] if "RGBA" in channels else channels["RGB"]
    assert picture.pixels.shape[:2] == size[::-1], (path, picture.pixels.shape)
    return picture.pixels[..., :3].astype(float)


def write_png(path, linear):
    linear = np.clip(linear, 0, 1)
    display = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    rows = (display * 255).round().astype(np.uint8)
    height, width, _ = rows.shape
    body = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(body, 9)) + chunk(b"IEND", b""))


# Regions


def nearest(shape, origin, direction, at):
    """Distances to the ideal shape at a time, in frames; infinite where a ray misses it."""
    centre = np.array(shape["place"]) + at * np.array(shape.get("velocity", (0, 0, 0)))
    angle = math.radians(at * shape.get("turn", 0))
    turn = np.array([(math.cos(angle), -math.sin(angle), 0), (math.sin(angle), math.cos(angle), 0), (0, 0, 1)])
    o, d = (origin - centre) @ turn, direction @ turn
    with np.errstate(divide="ignore", invalid="ignore"):
        if shape["kind"] == "ball":
            a, b, c = (d * d).sum(-1), (d * o).sum(-1), (o * o).sum(-1) - shape["radius"] ** 2
            root = b * b - a * c
            return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        if shape["kind"] == "box":
            half = np.array(shape["half"])
            one, other = (-half - o) / d, (half - o) / d
            enter, leave = np.minimum(one, other).max(-1), np.maximum(one, other).min(-1)
            return np.where((enter < leave) & (enter > 0), enter, np.inf)
        far = -o[..., 1] / d[..., 1]
        hit = o + far[..., None] * d
        inside = (np.abs(hit[..., 0]) < shape["half"][0]) & (np.abs(hit[..., 2]) < shape["half"][1])
        return np.where((far > 0) & inside, far, np.inf)


def coverage(size, grid=4, times=17):
    """Share of each pixel and the shutter that each shape has; the last is that of none."""
    eye, forward = np.array(CAMERA["eye"]), np.array(CAMERA["at"]) - np.array(CAMERA["eye"])
    axes = np.array(look(forward, (0, 1, 0)).to_3x3())
    scale = math.tan(math.radians(CAMERA["fovy"]) / 2)
    # Corners of the pixel, too: what only touches it counts.
    steps = np.linspace(0, 1, grid)
    seen = np.zeros((size[1], size[0], len(SHAPES) + 1))
    for at in np.linspace(*EXPOSED, times):
        for down in steps:
            for right in steps:
                x = (2 * (np.arange(size[0]) + right) - size[0]) / size[1] * scale
                y = (size[1] - 2 * (np.arange(size[1]) + down)) / size[1] * scale
                x, y = np.meshgrid(x, y)
                direction = np.stack([x, y, np.full_like(x, -1)], -1) @ axes.T
                far = [nearest(shape, eye, direction, at) for shape in SHAPES]
                first = np.argmin(np.stack(far + [np.full_like(far[0], 1e30)]), 0)
                np.put_along_axis(seen, first[..., None], np.take_along_axis(seen, first[..., None], -1) + 1, -1)
    return seen / (times * grid * grid)


def regions(size, truth):
    share = coverage(size)
    names = [shape["name"] for shape in SHAPES]
    travel = np.array(SUN["direction"])
    lit = -travel[1] / np.linalg.norm(travel) * np.array(SHAPES[0]["colour"])
    light = (truth / lit).mean(-1)
    floor = share[..., 0] == 1
    found = {
        "floor, lit": floor & (light > 0.995),
        "floor, umbra": floor & (light < 0.005),
        "floor, penumbra and moving shadows": floor & (light >= 0.005) & (light <= 0.995),
    }
    moving = share[..., names.index("flying")] + share[..., names.index("spinning")]
    found["ball at rest, inside"] = share[..., names.index("resting")] == 1
    found["moving ball and box, with what is behind them"] = moving > 0
    edge = (share.max(-1) < 1) & (moving == 0)
    found["outlines at rest"] = edge
    found["nothing"] = share[..., -1] == 1
    return found


def blocks(difference, side=8):
    """The greatest of the means of differences over squares of pixels, and where it is."""
    height, width = (n // side * side for n in difference.shape[:2])
    means = difference[:height, :width].reshape(height // side, side, width // side, side, 3).mean((1, 3))
    at = np.unravel_index(np.abs(means).argmax(), means.shape)
    return abs(means[at]), (int(at[1]) * side, int(at[0]) * side), "rgb"[at[2]]


def report(name, picture, truth, found):
    difference = picture - truth
    mean = np.abs(difference).mean()
    worst, at, channel = blocks(difference)
    print(f"\n{name}: mean difference {mean:.5f}, bias {' '.join(f'{v:+.5f}' for v in difference.mean((0, 1)))}")
    print(f"  worst mean of 8 x 8 pixels {worst:.4f} ({channel}, from {at[0]},{at[1]})", end="")
    print(f"; worst pixel {np.abs(difference).max():.4f}")
    for region, mask in found.items():
        part = difference[mask]
        if len(part):
            row = len(part), np.abs(part).mean(), part.mean(), np.sqrt((part**2).mean()), np.abs(part).max()
            print("  {:46} {:6} pixels  mean {:.5f}  bias {:+.5f}  rms {:.5f}  worst {:.4f}".format(region, *row))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("splatblur")
    parser.add_argument("folder")
    parser.add_argument("--size", default="480x270")
    parser.add_argument("--mode", default="supersample:256", help="of splatblur render")
    parser.add_argument("--samples", type=int, default=1024, help="of Cycles and of splatblur reference")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--keep", action="store_true", help="pictures that are in FOLDER are not made again")
    options = parser.parse_args()
    size = tuple(int(n) for n in options.size.split("x"))
    folder = options.folder
    os.makedirs(folder, exist_ok=True)
    write_scene(folder, size)
    names = "splatblur", "reference", "cycles", "cycles, another seed"
    made = {name: f"{folder}/{name}/scene.0000.exr" for name in names}

    def wanted(name):
        return not (options.keep and os.path.exists(made[name]))

    def run(name, *arguments):
        if wanted(name):
            arguments = [*arguments, "--format", "exr", f"{folder}/scene.xml", "--out", f"{folder}/{name}"]
            start = time.time()
            subprocess.run([options.splatblur, *arguments], check=True)
            print(f"{name}: {time.time() - start:.1f} s")

    run("splatblur", "render", "--mode", options.mode, "--backend", "cpu")
    run("reference", "reference", "--samples", str(options.samples))
    for seed, name in enumerate(names[2:]):
        if wanted(name):
            scene = build(size, options.samples, options.threads, seed)
            os.makedirs(f"{folder}/{name}", exist_ok=True)
            bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(f"{folder}/{name}/scene.blend"))
            scene.render.filepath = os.path.abspath(made[name])
            start = time.time()
            with quiet(f"{folder}/{name}/log.txt"):
                bpy.ops.render.render(write_still=True)
            print(f"{name}: {time.time() - start:.1f} s")

    pictures = {name: read(path, size) for name, path in made.items()}
    truth = pictures["cycles"]
    found = regions(size, truth)
    print(f"Blender {bpy.app.version_string}; splatblur in mode {options.mode}; {options.samples} samples else")
    for name, picture in pictures.items():
        write_png(f"{folder}/{name}/picture.png", picture)
        if name != "cycles":
            report(f"{name} against cycles", picture, truth, found)
            # Ten times the difference, on grey.
            write_png(f"{folder}/{name}/difference.png", 0.2 + 10 * (picture - truth))
    report("splatblur against reference", pictures["splatblur"], pictures["reference"], found)


if __name__ == "__main__":
    main()
