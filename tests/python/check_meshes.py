"""Whether AO4D reads meshes as the libraries do that write them: points, cells and arrays, number by number.

    check_meshes.py AO4D FOLDER

Writes files by meshio, VTK and gmsh into FOLDER, reads each by its library into a reference of plain text, and lets `ao4d compare` hold
the file against it. Prints how many files there were; exits with 1 and a message at the first thing that is wrong.
"""

import subprocess
import sys
from pathlib import Path

import gmsh
import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

AO4D, FOLDER = sys.argv[1], Path(sys.argv[2])
RANDOM = np.random.default_rng(5)
COUNT = 0


def check(condition, *message):
    if not condition:
        sys.exit("check_meshes: " + " ".join(str(m) for m in message))


def name(ending):
    global COUNT
    COUNT += 1
    return FOLDER / f"mesh{COUNT}{ending}"


KINDS = {"f4": "Float32", "f8": "Float64", "i1": "Int8", "u1": "UInt8", "i2": "Int16", "u2": "UInt16", "i4": "Int32",
         "u4": "UInt32", "i8": "Int64", "u8": "UInt64"}


def array(label, values):
    values = np.asarray(values)
    components = values.shape[1] if values.ndim > 1 else 1
    kind = KINDS[values.dtype.str[1:]]
    numbers = " ".join(repr(x.item()) for x in values.ravel())
    return f'<DataArray type="{kind}" Name="{label}" NumberOfComponents="{components}" format="ascii">{numbers}</DataArray>'


def reference(points, cells, point_data=None, cell_data=None):
    """A .vtu of plain text; cells are pairs of VTK's type and indices."""
    points = np.asarray(points, "f8")
    arrays = lambda data: "".join(array(k, v) for k, v in (data or {}).items())
    ends = np.cumsum([len(c) for _, c in cells])
    joined = np.concatenate([np.asarray(c, "i8") for _, c in cells])
    path = FOLDER / "reference.vtu"
    path.write_text(
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"><Points>{array("p", points)}</Points><Cells>'
        f'{array("connectivity", joined)}{array("offsets", ends)}{array("types", np.array([t for t, _ in cells], "u1"))}</Cells>'
        f"<PointData>{arrays(point_data)}</PointData><CellData>{arrays(cell_data)}</CellData>"
        "</Piece></UnstructuredGrid></VTKFile>"
    )
    return path


def same(path, points, cells, point_data=None, cell_data=None, only=None):
    """Holds AO4D's reading of a file against these numbers."""
    options = [f"--array={name}" for name in only or []]
    run = subprocess.run(
        [AO4D, "compare", path, reference(points, cells, point_data, cell_data), "--atol=0", "--rtol=1e-7", *options],
        capture_output=True,
        text=True,
    )
    check(run.returncode == 0, path, run.stdout, run.stderr)


# Meshes: a square of triangles, one of triangles and quadrilaterals, and solids of every kind.
GRID = np.array([[x, y, 0.25 * x * y] for y in range(4) for x in range(5)], "f8")
QUADS = [[5 * y + x, 5 * y + x + 1, 5 * y + x + 6, 5 * y + x + 5] for y in range(3) for x in range(4)]
TRIANGLES = [t for a, b, c, d in QUADS for t in ([a, b, c], [a, c, d])]
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], "f8") / 3
HEX = [0, 1, 3, 2, 4, 5, 7, 6]
SOLID_POINTS = np.vstack([CUBE, CUBE + [1, 0, 0], CUBE + [0, 1, 0], CUBE + [0, 0, 1]])
SOLIDS = [
    ("hexahedron", [HEX]),
    ("wedge", [[8, 9, 10, 12, 13, 14]]),
    ("pyramid", [[16, 17, 19, 18, 20]]),
    ("tetra", [[24, 25, 26, 28], [25, 27, 26, 28]]),
]
MESHES = {
    "triangles": (GRID, [("triangle", TRIANGLES)]),
    "mixed": (GRID, [("triangle", TRIANGLES[:8]), ("quad", QUADS[4:])]),
    "solids": (SOLID_POINTS, SOLIDS),
    "tetrahedra": (SOLID_POINTS, [SOLIDS[3]]),
}


VTK_TYPE = {v: k for k, v in meshio._vtk_common.vtk_to_meshio_type.items()}


def cells_of(mesh, ending=".msh"):
    """All cells as the file has them: in VTK's files meshio turns wedges round, AO4D never does."""
    turned = [0, 2, 1, 3, 5, 4] if ending in (".vtu", ".vtk") else range(6)
    order = lambda c: [c[i] for i in turned] if len(c) == 6 else list(c)
    return [(VTK_TYPE[b.type], order(c)) for b in mesh.cells for c in b.data]


def by_meshio(label, ending, data=True, **options):
    points, cells = MESHES[label]
    count = sum(len(c) for _, c in cells)
    mesh = meshio.Mesh(points, cells)
    if data:
        mesh.point_data = {"height": RANDOM.normal(size=len(points)), "v": RANDOM.normal(size=(len(points), 3))}
        split = np.cumsum([len(c) for _, c in cells])[:-1]
        mesh.cell_data = {"number": np.split(np.arange(count, dtype="i4"), split)}
    path = name(ending)
    mesh.write(path, **options)
    read = meshio.read(path)
    cell_data = {k: np.concatenate(v) for k, v in read.cell_data.items()}
    only = ["points"] if not data else ["points", "height", "v", "number"]
    if ending in (".msh", ".ply", ".stl", ".obj"):
        only = ["points"]
        same(path, read.points, cells_of(read), only=only)
    else:
        same(path, read.points, cells_of(read, ending), read.point_data, cell_data, only)


for label in MESHES:
    for options in ({"binary": False}, {"compression": None}, {"compression": "zlib"}, {"compression": "lzma"}):
        by_meshio(label, ".vtu", **options)
    for binary in (True, False):
        by_meshio(label, ".vtk", binary=binary)
        # In 4.1 meshio wants to be told the geometry behind cells of several kinds.
        for version in ("gmsh22", "gmsh") if len(MESHES[label][1]) == 1 else ("gmsh22",):
            by_meshio(label, ".msh", data=False, binary=binary, file_format=version)
    for version in ("vtk42", "vtk51"):
        by_meshio(label, ".vtk", file_format=version)
for label, binary in ((m, b) for m in ("triangles", "mixed") for b in (True, False)):
    by_meshio(label, ".ply", data=False, binary=binary)
by_meshio("triangles", ".obj", data=False)
by_meshio("mixed", ".obj", data=False)


def corners(points, cells):
    """Cells as the places of their corners, sorted: the same however points are numbered."""
    return sorted((kind, *np.round(np.asarray(points)[list(c)], 9).ravel()) for kind, c in cells)


# gmsh: a curved solid of tetrahedra, and one of layers; its elements, whatever they are numbered, are those of the file.
KIND_OF_GMSH = {15: 1, 1: 3, 2: 5, 3: 9, 4: 10, 5: 12, 6: 13, 7: 14}
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
for shape in ("solid", "layers"):
    gmsh.clear()
    gmsh.model.add(shape)
    if shape == "solid":
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.addBox(2, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
    else:
        face = gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
        gmsh.model.occ.extrude([(2, face)], 0, 0, 1, numElements=[2], recombine=True)
        gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(3)
    for version, binary in ((2.2, 0), (2.2, 1), (4.1, 0), (4.1, 1)):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        path = name(".msh")
        gmsh.write(str(path))
        read = meshio.read(path)
        same(path, read.points, cells_of(read), only=["points"])
        tags, places, _ = gmsh.model.mesh.getNodes()
        place = dict(zip(tags, np.reshape(places, (-1, 3))))
        own = []
        for kind, _, nodes in zip(*gmsh.model.mesh.getElements()):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            own += [(KIND_OF_GMSH[kind], *np.round([place[n] for n in c], 9).ravel()) for c in np.reshape(nodes, (-1, size))]
        check(sorted(own) == corners(read.points, cells_of(read)), path, "holds other elements than gmsh has")
gmsh.finalize()


# VTK.
def grid_of(points, cells):
    grid = vtk.vtkUnstructuredGrid()
    places = vtk.vtkPoints()
    places.SetData(numpy_to_vtk(np.asarray(points, "f4"), deep=True))
    grid.SetPoints(places)
    for kind, block in cells:
        for c in block:
            grid.InsertNextCell(VTK_TYPE[kind], len(c), [int(i) for i in c])
    return with_data(grid)


def with_data(data):
    for holder, count in ((data.GetPointData(), data.GetNumberOfPoints()), (data.GetCellData(), data.GetNumberOfCells())):
        for label, values in (("f", RANDOM.normal(size=count)), ("n", np.arange(3 * count, dtype="i4").reshape(-1, 3))):
            values = numpy_to_vtk(values, deep=True)
            values.SetName(label)
            holder.AddArray(values)
    return data


def numbers_of(data):
    """Points, cells and arrays of a data set of VTK."""
    points = vtk_to_numpy(data.GetPoints().GetData())
    ids = lambda c: [c.GetPointId(i) for i in range(c.GetNumberOfPoints())]
    cells = [(data.GetCellType(i), ids(data.GetCell(i))) for i in range(data.GetNumberOfCells())]
    # A voxel's and a pixel's points are in an order of their own, which GetCell keeps.
    arrays = lambda d: {d.GetArrayName(i): vtk_to_numpy(d.GetArray(i)) for i in range(d.GetNumberOfArrays())}
    return points, cells, arrays(data.GetPointData()), arrays(data.GetCellData())


def by_vtk(writer, reader, data, path, **settings):
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    for setting, value in settings.items():
        getattr(writer, setting)(value)
    check(writer.Write() == 1, path, "can't be written")
    reader.SetFileName(str(path))
    reader.Update()
    same(path, *numbers_of(reader.GetOutput()))


def polygons():
    data = vtk.vtkPolyData()
    places = vtk.vtkPoints()
    places.SetData(numpy_to_vtk(GRID.astype("f4"), deep=True))
    data.SetPoints(places)
    for set_cells, cells in (
        (data.SetVerts, [[0], [3, 4]]),
        (data.SetLines, [[0, 1], [5, 6, 7]]),
        (data.SetPolys, TRIANGLES[:4] + QUADS[4:8] + [[10, 11, 12, 17, 16]]),
        (data.SetStrips, [[12, 17, 13, 18, 14, 19]]),
    ):
        array = vtk.vtkCellArray()
        for c in cells:
            array.InsertNextCell(len(c), c)
        set_cells(array)
    return with_data(data)


# Each data mode, with each compressor, width of lengths and byte order.
MODES = [
    {"SetDataMode": mode, "SetHeaderType": header, "SetByteOrder": order, "SetCompressorType": compressor}
    for mode in (0, 1, 2)
    for header, order, compressor in ((32, 0, 0), (64, 1, 1), (64, 1, 2), (32, 1, 3), (64, 0, 1))
]
for settings in MODES:
    by_vtk(vtk.vtkXMLPolyDataWriter(), vtk.vtkXMLPolyDataReader(), polygons(), name(".vtp"), **settings)
    for label in ("mixed", "solids"):
        data = grid_of(*MESHES[label])
        by_vtk(vtk.vtkXMLUnstructuredGridWriter(), vtk.vtkXMLUnstructuredGridReader(), data, name(".vtu"), **settings)
for kind in (1, 2):
    for version in (42, 51):
        settings = {"SetFileType": kind, "SetFileVersion": version}
        by_vtk(vtk.vtkPolyDataWriter(), vtk.vtkPolyDataReader(), polygons(), name(".vtk"), **settings)
        data = grid_of(*MESHES["solids"])
        by_vtk(vtk.vtkUnstructuredGridWriter(), vtk.vtkUnstructuredGridReader(), data, name(".vtk"), **settings)


# Pieces in files of their own, and several in one list over time.
def in_pieces(writer, piece_of, pieces, path):
    writer.SetFileName(str(path))
    writer.SetNumberOfPieces(pieces)
    writer.SetStartPiece(0)
    writer.SetEndPiece(pieces - 1)
    writer.SetInputConnection(piece_of.GetOutputPort())
    check(writer.Write() == 1, path, "can't be written")


sphere = vtk.vtkSphereSource()
sphere.SetThetaResolution(12)
sphere.SetPhiResolution(7)
path = name(".pvtp")
in_pieces(vtk.vtkXMLPPolyDataWriter(), sphere, 3, path)
reader = vtk.vtkXMLPPolyDataReader()
reader.SetFileName(str(path))
reader.Update()
same(path, *numbers_of(reader.GetOutput()))

wavelet = vtk.vtkRTAnalyticSource()
wavelet.SetWholeExtent(0, 4, 0, 3, 0, 2)
solid = vtk.vtkDataSetTriangleFilter()
solid.SetInputConnection(wavelet.GetOutputPort())
path = name(".pvtu")
in_pieces(vtk.vtkXMLPUnstructuredGridWriter(), solid, 2, path)
reader = vtk.vtkXMLPUnstructuredGridReader()
reader.SetFileName(str(path))
reader.Update()
same(path, *numbers_of(reader.GetOutput()))

parts = []
for shift in (0, 10):
    part = name(".vtu")
    data = grid_of(SOLID_POINTS + shift, SOLIDS)
    by_vtk(vtk.vtkXMLUnstructuredGridWriter(), vtk.vtkXMLUnstructuredGridReader(), data, part)
    parts.append((part, numbers_of(data)))
collection = name(".pvd")
sets = "".join(f'<DataSet timestep="0.5" part="{i}" file="{part.name}"/>' for i, (part, _) in enumerate(parts))
collection.write_text(f'<VTKFile type="Collection" version="0.1"><Collection>{sets}</Collection></VTKFile>')
(_, (p, c, pd, cd)), (_, (q, d, qd, dd)) = parts
behind = [(kind, [i + len(p) for i in cell]) for kind, cell in d]
stacked = lambda a, b: {k: np.concatenate([a[k], b[k]]) for k in a}
same(collection, np.vstack([p, q]), c + behind, stacked(pd, qd), stacked(cd, dd))
series = name(".vtu.series")
series.write_text('{"file-series-version": "1.0", "files": [{"name": "%s", "time": 3}]}' % parts[0][0].name)
same(series, *parts[0][1])

print(COUNT)
