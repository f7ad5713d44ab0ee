"""Whether VTK reads the lists of a run's pieces as the files that one process makes.

    check_pieces.py WHOLE PIECES

WHOLE is the output folder of a run, PIECES the folder of the first piece of one. Every `.pvti` and `.pvtu` in PIECES is read as a whole,
and as ParaView's servers read it, each its share, and held against the file of its name in WHOLE: extents, places, arrays, voxel for
voxel and simplex for simplex. Prints how many lists there were; exits with 1 and a message at the first thing that is wrong.
"""

import sys
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkIOXML import (
    vtkXMLImageDataReader,
    vtkXMLPImageDataReader,
    vtkXMLPUnstructuredGridReader,
    vtkXMLUnstructuredGridReader,
)

WHOLE, PIECES = Path(sys.argv[1]), Path(sys.argv[2])
COMPLAINTS = []


def check(condition, *message):
    if not condition:
        sys.exit("check_pieces: " + " ".join(str(m) for m in message))


def reader(kind, path):
    made = kind()
    made.SetFileName(str(path))
    for event in ("ErrorEvent", "WarningEvent"):
        made.AddObserver(event, lambda *_: COMPLAINTS.append(path))
    return made


def read(kind, path):
    made = reader(kind, path)
    made.Update()
    check(not COMPLAINTS, "VTK complains of", path)
    return made.GetOutput()


def arrays(data):
    points = data.GetPointData()
    names = [points.GetArrayName(i) for i in range(points.GetNumberOfArrays())]
    return {name: vtk_to_numpy(points.GetArray(name)) for name in names}


def same(a, b, *message):
    check(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), *message)


def check_image(path, whole):
    whole, found = read(vtkXMLImageDataReader, whole), read(vtkXMLPImageDataReader, path)
    check(whole.GetExtent() == found.GetExtent(), path, whole.GetExtent(), found.GetExtent())
    check(whole.GetOrigin() == found.GetOrigin() and whole.GetSpacing() == found.GetSpacing(), path, "lies elsewhere")
    expected, all_found = arrays(whole), arrays(found)
    check(list(expected) == list(all_found), path, list(expected), list(all_found))
    for name in expected:
        same(expected[name], all_found[name], path, name)
    x, y, z = whole.GetDimensions()
    for servers in (2, 3):
        seen = np.zeros(z, bool)
        for server in range(servers):
            one = reader(vtkXMLPImageDataReader, path)
            one.UpdatePiece(server, servers, 0)
            check(not COMPLAINTS, "VTK complains of", path, "by", servers, "servers")
            part = one.GetOutput()
            e = part.GetExtent()
            if part.GetNumberOfPoints() == 0:
                continue
            seen[e[4] : e[5] + 1] = True
            for name, values in arrays(part).items():
                shape = expected[name].shape[1:]
                grid = expected[name].reshape((z, y, x) + shape)
                own = np.ascontiguousarray(grid[e[4] : e[5] + 1, e[2] : e[3] + 1, e[0] : e[1] + 1]).reshape((-1,) + shape)
                same(own, values, path, name, "of server", server, "of", servers)
        check(seen.all(), path, "has layers that no server reads")


def simplices(data):
    """All that a mesh says of each corner of each simplex, a row a simplex, in an order that depends on nothing else."""
    corners = vtk_to_numpy(data.GetCells().GetConnectivityArray())
    count = data.GetNumberOfCells()
    columns = [vtk_to_numpy(data.GetPoints().GetData())[corners]] if count else []
    columns += [values[corners].reshape(len(corners), -1) for _, values in sorted(arrays(data).items())]
    rows = np.concatenate([np.asarray(c, "<f8") for c in columns], axis=1).reshape(count, -1)
    return rows[np.lexsort(rows.T)]


def check_mesh(path, whole):
    whole, found = read(vtkXMLUnstructuredGridReader, whole), read(vtkXMLPUnstructuredGridReader, path)
    check(list(arrays(whole)) == list(arrays(found)), path, list(arrays(whole)), list(arrays(found)))
    check(whole.GetNumberOfCells() == found.GetNumberOfCells() > 0, path, "has other simplices")
    same(simplices(whole), simplices(found), path)


vtkObject.GlobalWarningDisplayOff()
images, meshes = sorted(PIECES.rglob("*.pvti")), sorted(PIECES.rglob("*.pvtu"))
for path in images:
    check_image(path, WHOLE / path.relative_to(PIECES).with_suffix(".vti"))
for path in meshes:
    check_mesh(path, WHOLE / path.relative_to(PIECES).with_suffix(".vtu"))
print(len(images) + len(meshes))
