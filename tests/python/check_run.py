"""What VTK reads of a run's outputs.

    check_run.py FOLDER     prints, as JSON, what VTK reads of each .vti and .vtu there: names, types, components,
                            dimensions, origin, spacing, field data, a few voxels, and the sums of the arrays

A .raw beside a .vti of the same name is read by VTK's image reader as the README says, and its sums are printed too.
"""

import json
import sys
from pathlib import Path

import vtk
from vtk.util.numpy_support import vtk_to_numpy


def read(reader, path):
    complaints = []

    def note(_object, _event, text):
        complaints.append(text)

    note.CallDataType = "string0"
    reader.AddObserver("ErrorEvent", note)
    reader.AddObserver("WarningEvent", note)
    reader.SetFileName(str(path))
    reader.Update()
    if complaints:
        sys.exit(f"{path.name}: {complaints}")
    return reader.GetOutput()


def arrays(attributes):
    found = {}
    for i in range(attributes.GetNumberOfArrays()):
        array = attributes.GetArray(i)
        numbers = vtk_to_numpy(array).reshape(array.GetNumberOfTuples(), -1)
        finite = numbers[abs(numbers) < 1e30]
        found[array.GetName()] = {
            "type": array.GetDataTypeAsString(),
            "components": array.GetNumberOfComponents(),
            "tuples": array.GetNumberOfTuples(),
            "sum": float(finite.astype("float64").sum()),
        }
    return found


def image(data):
    opacity = data.GetPointData().GetArray("opacity")
    opaque = [i for i, o in enumerate(vtk_to_numpy(opacity)) if o == 1] if opacity else []
    place = opaque[len(opaque) // 3] if opaque else 0
    strings = data.GetFieldData()
    names = [strings.GetAbstractArray(i).GetName() for i in range(strings.GetNumberOfArrays())]
    point = data.GetPointData()
    voxel = {
        point.GetArray(i).GetName(): list(point.GetArray(i).GetTuple(place)) for i in range(point.GetNumberOfArrays())
    }
    return {
        "dimensions": list(data.GetDimensions()),
        "origin": list(data.GetOrigin()),
        "spacing": list(data.GetSpacing()),
        "field_data": {n: strings.GetAbstractArray(n).GetValue(0) for n in names},
        "place": place,
        "point": list(data.GetPoint(place)),
        "voxel": voxel,
        "arrays": arrays(point),
    }


def raw(path, dimensions, place):
    reader = vtk.vtkImageReader()
    reader.SetDataScalarTypeToFloat()
    reader.SetDataByteOrderToLittleEndian()
    reader.SetNumberOfScalarComponents(3)
    reader.SetFileDimensionality(3)
    reader.FileLowerLeftOn()
    reader.SetDataExtent(0, dimensions[0] - 1, 0, dimensions[1] - 1, 0, dimensions[2] - 1)
    scalars = read(reader, path).GetPointData().GetScalars()
    return {"voxel": list(scalars.GetTuple(place))}


folder = Path(sys.argv[1])
result = {}
for path in sorted(folder.glob("*.vti")):
    result[path.name] = image(read(vtk.vtkXMLImageDataReader(), path))
    other = path.with_suffix(".raw")
    if other.exists():
        result[other.name] = raw(other, result[path.name]["dimensions"], result[path.name]["place"])
for path in sorted(folder.glob("*.vtu")):
    mesh = read(vtk.vtkXMLUnstructuredGridReader(), path)
    kinds = sorted({mesh.GetCellType(i) for i in range(mesh.GetNumberOfCells())})
    result[path.name] = {
        "points": mesh.GetNumberOfPoints(),
        "cells": mesh.GetNumberOfCells(),
        "kinds": kinds,
        "arrays": arrays(mesh.GetPointData()),
    }
json.dump(result, sys.stdout)
