"""Makes the tables and arrays of this folder with numpy and pandas, which people use to write them.

    python make.py

truth.csv has the numbers with all their digits, written by Python alone.
"""

import numpy as np
import pandas as pd

rng = np.random.default_rng(45)
n = 7
place = np.round(rng.uniform(-10, 10, (n, 3)), 6)
velocity = np.round(rng.normal(0, 2, (n, 3)), 4).astype(np.float32)
colour = rng.integers(0, 256, (n, 3), dtype=np.uint8)
radius = np.round(rng.uniform(0.1, 0.5, n), 5)
pressure = np.round(rng.normal(1e5, 50, n), 3)
ident = np.array([5, 3, 2**40, 11, 2, 7, 1], dtype=np.int64)

with open("truth.csv", "w") as out:
    for i in range(n):
        row = [*place[i], *(float(v) for v in velocity[i]), *colour[i], radius[i], pressure[i], ident[i]]
        out.write(",".join(repr(v.item() if hasattr(v, "item") else v) for v in row) + "\n")

names = ["x", "y", "z", "vx", "vy", "vz", "red", "green", "blue", "radius", "pressure", "id"]
columns = [*place.T, *velocity.T, *colour.T, radius, pressure, ident]
frame = pd.DataFrame(dict(zip(names, columns)))
frame.insert(3, "name", [f"point, {i}" for i in range(n)])
frame.to_csv("pandas_index.csv")
frame.to_csv("pandas.csv", index=False)
frame.to_csv("semicolons.csv", index=False, sep=";")
frame.drop(columns="name").to_csv("tabs.txt", index=False, sep="\t")
frame.drop(columns="name").to_csv("bars.txt", index=False, sep="|")
frame.drop(columns="name").to_csv("blanks.txt", index=False, sep=" ")
np.savetxt("savetxt.txt", frame.drop(columns="name").to_numpy(), header=" ".join(names), fmt="%.17g")
paraview = frame.drop(columns=["name", "x", "y", "z", "vx", "vy", "vz"])
for i in range(3):
    paraview[f"velocity:{i}"] = velocity[:, i]
for i in range(3):
    paraview[f"Points:{i}"] = place[:, i]
paraview.to_csv("paraview.csv", index=False, quoting=1)

np.save("records.npy", frame.drop(columns="name").to_records(index=False))
nested = np.zeros(n, dtype=[("label", "U8"), ("position", ">f8", 3), ("velocity", "<f4", 3), ("rgb", "u1", 3),
                            ("radius", "f8"), ("pressure", "f8"), ("id", "<i8")])
nested["position"], nested["velocity"], nested["rgb"] = place, velocity, colour
nested["radius"], nested["pressure"], nested["id"] = radius, pressure, ident
np.save("nested.npy", nested)
np.save("places.npy", place)
np.save("places_fortran.npy", np.asfortranarray(place))
arrays = dict(positions=place, velocities=velocity, colors=colour, radii=radius, pressure=pressure, ids=ident)
np.savez("arrays.npz", **arrays, faces=np.zeros((3, 3), dtype=np.int32))
np.savez_compressed("packed.npz", **arrays)
np.savez("single.npz", place)
