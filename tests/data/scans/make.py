"""Makes the files beside it with the libraries that people use for them.

    pip install laspy==2.7.0 lazrs==0.8.2 pye57==0.4.19 copclib==2.6.3 numpy
    python tests/data/scans/make.py

`points.csv` has what they hold. The points are random; nobody has rights in them.
"""

import pathlib

import copclib
import laspy
import numpy as np
import pye57

here = pathlib.Path(__file__).parent
rng = np.random.default_rng(44)
count = 120
place = np.round(rng.uniform(-20, 20, (count, 3)), 3)
# A place in UTM.
place += [500_000, 4_649_000, 120]
colour = rng.integers(0, 65536, (count, 3)).astype(np.uint16)
intensity = rng.integers(0, 4000, count).astype(np.uint16)
kind = rng.choice([1, 2, 6, 7], count).astype(np.uint8)
station = (np.arange(count) >= 70).astype(int)

with open(here / "points.csv", "w") as file:
    file.write("x,y,z,red,green,blue,intensity,class,station\n")
    for i in range(count):
        numbers = [*(f"{x:.3f}" for x in place[i]), *colour[i], intensity[i], kind[i], station[i]]
        file.write(",".join(map(str, numbers)) + "\n")

for name, number, version, bits in [
    ("0.laz", 0, "1.1", None),
    ("1.las", 1, "1.2", None),
    ("2.laz", 2, "1.2", 8),
    ("3.laz", 3, "1.2", 16),
    ("6.laz", 6, "1.4", None),
    ("7.las", 7, "1.4", 16),
    ("7.laz", 7, "1.4", 16),
    ("8.laz", 8, "1.4", 8),
]:
    header = laspy.LasHeader(point_format=number, version=version)
    header.offsets, header.scales = [500_000, 4_649_000, 0], [0.001] * 3
    if name == "7.laz":
        header.add_extra_dim(laspy.ExtraBytesParams(name="height", type=np.float32))
    data = laspy.LasData(header)
    data.x, data.y, data.z = place.T
    data.intensity, data.classification = intensity, kind
    if bits:
        data.red, data.green, data.blue = (colour if bits == 16 else colour // 257).T
    if name == "7.laz":
        data.height = place[:, 2].astype(np.float32)
    if name == "6.laz":
        # The last one is withheld.
        data.withheld = np.arange(count) == count - 1
    data.write(str(here / name))

# COPC: the chunks are those of an octree, here of two nodes.
config = copclib.CopcConfigWriter(7, [0.001] * 3, [500_000, 4_649_000, 0])
config.las_header.min = copclib.Vector3(*place.min(0))
config.las_header.max = copclib.Vector3(*place.max(0))
writer = copclib.FileWriter(str(here / "copc.laz"), config)
for key, part in [((0, 0, 0, 0), slice(0, 90)), ((1, 1, 1, 1), slice(90, count))]:
    points = copclib.Points(writer.copc_config.las_header)
    for x, c, i, k in zip(place[part], colour[part], intensity[part], kind[part]):
        point = points.CreatePoint()
        point.x, point.y, point.z = x
        point.red, point.green, point.blue = map(int, c)
        point.intensity, point.classification = int(i), int(k)
        points.AddPoint(point)
    writer.AddNode(copclib.VoxelKey(*key), points)
writer.Close()

(here / "two.e57").unlink(missing_ok=True)
file = pye57.E57(str(here / "two.e57"), mode="w")
# The scanner of the second scan is turned by a quarter about z: (w, x, y, z).
half = np.sqrt(0.5)
for number, (at, turn) in enumerate(
    [([500_001, 4_649_002, 121], [1, 0, 0, 0]), ([500_005, 4_649_000, 122], [half, 0, 0, half])]
):
    mine = station == number
    local = place[mine] - at
    if number == 1:
        local = np.stack([local[:, 1], -local[:, 0], local[:, 2]], 1)
    columns = {name: local[:, axis].copy() for axis, name in enumerate(["cartesianX", "cartesianY", "cartesianZ"])}
    for axis, name in enumerate(["colorRed", "colorGreen", "colorBlue"]):
        columns[name] = (colour[mine][:, axis] // 257).astype(np.uint8)
    columns["intensity"] = intensity[mine] / 4000.0
    columns["cartesianInvalidState"] = (np.arange(mine.sum()) == 3).astype(np.int8) * 2
    file.write_scan_raw(
        columns, name=f"station {number}", rotation=np.array(turn, float), translation=np.array(at, float)
    )
file.close()
