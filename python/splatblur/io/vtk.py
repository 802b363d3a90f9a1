"""VTK: points with columns of .vtk, .vtp, .vtu and .pvd files. It needs vtk (or pyvista, which brings it)."""

from __future__ import annotations

import os
import xml.etree.ElementTree as xml
from os import PathLike, fspath
from typing import Any

import numpy as np

from ._table import Table
from ._views import refused


_ENDS = (".vtk", ".vtp", ".vtu", ".vts", ".vtr", ".vti", ".pvd")


def times(path: str | PathLike[str]) -> list[float]:
    """The time steps of a `.pvd` file, in order."""
    return [time for time, _ in _series(fspath(path))]


def read(path: str | PathLike[str], *, step: int = 0) -> Table:
    """The points of a file, with its columns of points.

    Args:
        path: A `.vtk`, `.vtp`, `.vtu`, `.vts`, `.vtr` or `.vti` file, or a `.pvd` file, which lists others by time.
        step: The number of the time step of a `.pvd` file.

    Raises:
        ModelError: The file cannot be read, or has no points.
        ImportError: vtk is missing.
    """
    name = fspath(path)
    if name.lower().endswith(".pvd"):
        series = _series(name)
        if not -len(series) <= step < len(series):
            raise refused(name, f"{len(series)} time steps", f"step {step}")
        name = series[step][1]
    if not os.path.isfile(name):
        raise refused(name, "no file", "a file")
    data = _data(name)
    points = None if data is None or not hasattr(data, "GetPoint") else _positions(data)
    if points is None or len(points) == 0:
        raise refused(name, "no points", "a data set of VTK with points")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    columns = data.GetPointData()
    arrays = {}
    for index in range(columns.GetNumberOfArrays()):
        array = columns.GetArray(index)
        if array is not None and array.GetName():
            # Copied: the memory of the file's data set goes with it.
            arrays[array.GetName()] = np.array(vtk_to_numpy(array))
    return Table(points, list(arrays), arrays.__getitem__)


def _positions(data: Any) -> Any:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    if hasattr(data, "GetPoints") and data.GetPoints() is not None:
        points = data.GetPoints()
        return np.array(vtk_to_numpy(points.GetData() if hasattr(points, "GetData") else points))
    return np.array([data.GetPoint(index) for index in range(data.GetNumberOfPoints())])


def _data(name: str) -> Any:
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader
    from vtkmodules.vtkIOXML import vtkXMLGenericDataObjectReader

    end = os.path.splitext(name)[1].lower()
    if end not in _ENDS:
        raise refused(name, f"the extension {end!r}", f"one of {', '.join(_ENDS)}")
    is_legacy = end == ".vtk"
    reader: Any = vtkGenericDataObjectReader() if is_legacy else vtkXMLGenericDataObjectReader()
    # Readers of VTK print what is wrong, and hand out what they could read; here it is an exception.
    shown, said = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(said)
    try:
        reader.SetFileName(name)
        if is_legacy:
            reader.ReadAllScalarsOn()
            reader.ReadAllVectorsOn()
            reader.ReadAllNormalsOn()
            reader.ReadAllFieldsOn()
        reader.Update()
        data = reader.GetOutput()
    finally:
        vtkOutputWindow.SetInstance(shown)
    wrong = said.GetOutput().strip()
    if data is None or wrong:
        why = "; ".join(line.split("): ", 1)[-1] for line in wrong.splitlines() if "): " in line)
        raise refused(name, f"what its reader refuses ({why or 'there is no data'})"[:300], f"a {end} file of VTK")
    return data


def _series(name: str) -> list[tuple[float, str]]:
    try:
        root = xml.parse(name).getroot()
        found = [
            (float(each.get("timestep", "0")), os.path.join(os.path.dirname(name), each.attrib["file"]))
            for each in root.iter("DataSet")
        ]
    except OSError as why:
        raise refused(name, "no file", f"a .pvd file ({why})") from why
    except (xml.ParseError, ValueError, KeyError) as why:
        raise refused(name, "no list of data sets", f"a .pvd file ({why})") from why
    return sorted(found, key=lambda each: each[0])
