"""Files of other programs, read by their own libraries, as points, captures, cameras and scenes.

Each module needs its library, which is an extra: `pip install "splatblur[usd,vtk,hdf5]"`. `colmap` and `nerfstudio`
need none, `gsplat` needs torch for `.pt` files alone. What the program reads by itself is not here: `splatblur.load`.
"""

from . import colmap, gsplat, hdf5, nerfstudio, usd, vtk
from ._views import Views

__all__ = ["Views", "colmap", "gsplat", "hdf5", "nerfstudio", "usd", "vtk"]
