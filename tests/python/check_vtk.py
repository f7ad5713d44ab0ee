"""What VTK's own readers and writers say about image and mesh files.

    check_vtk.py ours FOLDER     reads every file that tests/paraview/vtk_files.rs has put there, and checks each number
    check_vtk.py theirs FOLDER   writes files there in every way that VTK knows, each beside a reference in plain text

Prints how many files there were; exits with 1 and a message at the first thing that is wrong.
"""

import sys
from pathlib import Path

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy


def check(condition, *message):
    if not condition:
        sys.exit("check_vtk: " + " ".join(str(m) for m in message))


class Complaints:
    """Collects what VTK would print, for its readers complain without failing."""

    def __init__(self, algorithm):
        self.texts = []
        algorithm.AddObserver("ErrorEvent", self.note)
        algorithm.AddObserver("WarningEvent", self.note)
        self.note.__func__.CallDataType = "string0"

    def note(self, _object, _event, text):
        self.texts.append(text)


def read(reader, path):
    complaints = Complaints(reader)
    reader.SetFileName(str(path))
    reader.Update()
    check(not complaints.texts, path.name, *complaints.texts)
    return reader.GetOutput()


# The image and the mesh of tests/paraview/vtk_files.rs.


def ours_image(n):
    i, i4 = np.arange(n), np.arange(4 * n)

    def real(k):
        return ((k * 7919) % 1009).astype(np.float32) / np.float32(1009)

    return {
        "rgba": ((i4 // 3) % 251).astype(np.uint8).reshape(n, 4),
        "ambient_occlusion": real(i),
        "object": (i % 65536).astype(np.uint16),
        "normal": (real(i4) - np.float32(0.5)).reshape(n, 4),
        "depth": np.where(i % 5 == 0, np.float32(np.inf), real(i)).astype(np.float32),
    }


COMPONENTS = {"rgba": "rgba", "normal": "xyzw"}
FIELDS = {"pipeline": 'name: "ä & <b>"\nstages: []\n', "version": "0.1.0", "nothing": ""}


def check_arrays(path, attributes, expected):
    check(attributes.GetNumberOfArrays() == len(expected), path.name, "has", attributes.GetNumberOfArrays(), "arrays")
    for k, (name, values) in enumerate(expected.items()):
        array = attributes.GetArray(k)
        check(array.GetName() == name, path.name, array.GetName(), "is not", name)
        found = vtk_to_numpy(array)
        check(found.dtype == values.dtype and found.shape == values.shape, path.name, name, found.dtype, found.shape)
        check(np.array_equal(found, values), path.name, name, "differs")


def check_image(path, dimensions):
    image = read(vtk.vtkXMLImageDataReader(), path)
    check(image.GetDimensions() == dimensions, path.name, image.GetDimensions())
    check(image.GetOrigin() == (-1 / 3, 0.1, 1e-300), path.name, image.GetOrigin())
    check(image.GetSpacing() == (1 / 3, 0.7, 2 / 49), path.name, image.GetSpacing())
    check(image.GetPointData().GetScalars().GetName() == "rgba", path.name, "shows another array first")
    check(image.GetCellData().GetNumberOfArrays() == 0, path.name, "has cell data")
    n = int(np.prod(dimensions))
    expected = ours_image(n)
    check_arrays(path, image.GetPointData(), expected)
    for name, components in COMPONENTS.items():
        array = image.GetPointData().GetArray(name)
        names = [array.GetComponentName(c) for c in range(array.GetNumberOfComponents())]
        check(names == list(components), path.name, name, names)
    # A single voxel, at the place where VTK says that it is.
    i, j, k = (d - 1 for d in dimensions)
    i = i // 2
    flat = i + dimensions[0] * (j + dimensions[1] * k)
    check(image.GetPoint(flat)[0] == -1 / 3 + i * (1 / 3), path.name, image.GetPoint(flat))
    check(image.GetScalarComponentAsDouble(i, j, k, 2) == expected["rgba"][flat, 2], path.name, "voxel", i, j, k)
    field = image.GetFieldData()
    for name, text in FIELDS.items():
        found = field.GetAbstractArray(name)
        check(found is not None and found.GetNumberOfValues() == 1, path.name, "lacks", name)
        check(found.GetValue(0) == text, path.name, name, repr(found.GetValue(0)))
    check(field.GetArray("TimeValue").GetValue(0) == 0.1, path.name, "has another time")


def check_raw(path, dimensions):
    reader = vtk.vtkImageReader2()
    reader.SetFileDimensionality(3)
    reader.SetDataExtent(0, dimensions[0] - 1, 0, dimensions[1] - 1, 0, dimensions[2] - 1)
    reader.SetDataScalarTypeToFloat()
    reader.SetNumberOfScalarComponents(3)
    reader.SetDataByteOrderToLittleEndian()
    reader.FileLowerLeftOn()
    image = read(reader, path)
    n = 3 * int(np.prod(dimensions))
    expected = (np.arange(n).astype(np.float32) / np.float32(7)).reshape(-1, 3)
    check(path.stat().st_size == 4 * n, path.name, path.stat().st_size, "bytes")
    check(np.array_equal(vtk_to_numpy(image.GetPointData().GetScalars()), expected), path.name, "differs")


def check_mesh(path):
    mesh = read(vtk.vtkXMLUnstructuredGridReader(), path)
    if path.stem == "nothing":
        check(mesh.GetNumberOfPoints() == mesh.GetNumberOfCells() == 0, path.name, "is not empty")
        return
    third = np.float32(1) / np.float32(3)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, third], [1, 1, 1]], np.float32)
    check(np.array_equal(vtk_to_numpy(mesh.GetPoints().GetData()), points), path.name, "has other points")
    kind, cells = {
        "tetrahedra": (vtk.VTK_TETRA, [[0, 1, 2, 3], [1, 2, 3, 4]]),
        "triangles": (vtk.VTK_TRIANGLE, [[0, 1, 2], [1, 2, 4]]),
        "points": (None, []),
    }[path.stem]
    check(mesh.GetNumberOfCells() == len(cells), path.name, mesh.GetNumberOfCells(), "cells")
    for c, expected in enumerate(cells):
        cell = mesh.GetCell(c)
        found = [cell.GetPointId(p) for p in range(cell.GetNumberOfPoints())]
        check((cell.GetCellType(), found) == (kind, expected), path.name, cell.GetCellType(), found)
    arrays = {
        "position": (np.arange(20).astype(np.float32) / np.float32(3)).reshape(5, 4),
        "ambient_occlusion": np.arange(5).astype(np.float32) / np.float32(4),
        "object": np.array([1, 1, 2, 2, 65535], np.uint16),
    }
    check_arrays(path, mesh.GetPointData(), arrays)
    check_arrays(path, mesh.GetCellData(), {"measure": np.array([0.1, 0.2])} if cells else {})


def ours(folder):
    files = sorted(folder.iterdir())
    for path in files:
        if path.suffix == ".vtu":
            check_mesh(path)
            continue
        dimensions = tuple(int(n) for n in path.stem.split("-")[0].split("x"))
        (check_raw if path.suffix == ".raw" else check_image)(path, dimensions)
    print(len(files), "files checked by VTK", vtk.vtkVersion.GetVTKVersion())


# Files as VTK writes them.

# (mode, encoded, compressor, header bits, byte order): 27 of them.
WAYS = [("ascii", False, "", 32, "LittleEndian")]
WAYS += [
    (mode, encoded, compressor, bits, "LittleEndian")
    for mode, encoded in (("binary", False), ("appended", True), ("appended", False))
    for compressor in ("", "ZLib", "LZ4", "LZMA")
    for bits in (32, 64)
]
WAYS += [("appended", False, "", 32, "BigEndian"), ("binary", False, "ZLib", 64, "BigEndian")]

TYPES = {
    "Int8": np.int8, "UInt8": np.uint8, "Int16": np.int16, "UInt16": np.uint16, "Int32": np.int32,
    "UInt32": np.uint32, "Int64": np.int64, "UInt64": np.uint64, "Float32": np.float32, "Float64": np.float64,
}


def every_type(n):
    """An array of each type with its extreme values, and some with components."""
    arrays = {}
    for name, dtype in TYPES.items():
        info = np.finfo(dtype) if np.issubdtype(dtype, np.floating) else np.iinfo(dtype)
        values = np.resize(np.array([info.min, info.max, 0, 1, 97], dtype), n)
        if np.issubdtype(dtype, np.floating):
            values[n // 2] = dtype(1) / dtype(3)
        arrays[name] = values
    arrays["pairs"] = np.arange(2 * n, dtype=np.float32).reshape(n, 2) / np.float32(7)
    return arrays


def add_arrays(attributes, arrays):
    for name, values in arrays.items():
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        attributes.AddArray(array)


def bits(n):
    array = vtk.vtkBitArray()
    array.SetName("bits")
    for i in range(n):
        array.InsertNextValue(i % 3 == 0)
    return array


def fields(data):
    text = vtk.vtkStringArray()
    text.SetName("text")
    for line in ("name: ä", "", "end"):
        text.InsertNextValue(line)
    time = numpy_to_vtk(np.array([1 / 3]), deep=True)
    time.SetName("TimeValue")
    data.GetFieldData().AddArray(text)
    data.GetFieldData().AddArray(time)


def image(extent, arrays, cells=None, with_bits=False):
    data = vtk.vtkImageData()
    data.SetExtent(extent)
    data.SetOrigin(1 / 3, -0.1, 1e-7)
    data.SetSpacing(1 / 3, 0.7, 2 / 49)
    add_arrays(data.GetPointData(), arrays(data.GetNumberOfPoints()))
    if cells:
        add_arrays(data.GetCellData(), cells(data.GetNumberOfCells()))
    if with_bits:
        data.GetPointData().AddArray(bits(data.GetNumberOfPoints()))
    fields(data)
    return data


def points(n):
    positions = vtk.vtkPoints()
    positions.SetDataTypeToDouble()
    for i in range(n):
        positions.InsertNextPoint(i / 3, i * i / 7, -i)
    return positions


def mesh():
    data = vtk.vtkUnstructuredGrid()
    data.SetPoints(points(40))
    for i in range(30):
        kind, size = ((vtk.VTK_TETRA, 4), (vtk.VTK_TRIANGLE, 3))[i % 7 == 0]
        data.InsertNextCell(kind, size, [i + k for k in range(size)])
    position = np.arange(160, dtype=np.float32).reshape(40, 4) / np.float32(3)
    add_arrays(data.GetPointData(), {"position": position, **every_type(40)})
    add_arrays(data.GetCellData(), every_type(30))
    fields(data)
    return data


def poly():
    data = vtk.vtkPolyData()
    data.SetPoints(points(20))
    for kind, cells in (
        ("Verts", [[0], [1, 2]]), ("Lines", [[3, 4], [5, 6, 7]]),
        ("Polys", [[i, i + 1, i + 2] for i in range(10)] + [[0, 1, 2, 3]]), ("Strips", [[8, 9, 10, 11]]),
    ):
        array = vtk.vtkCellArray()
        for cell in cells:
            array.InsertNextCell(len(cell), cell)
        getattr(data, "Set" + kind)(array)
    add_arrays(data.GetPointData(), every_type(20))
    add_arrays(data.GetCellData(), every_type(data.GetNumberOfCells()))
    fields(data)
    return data


def large(n):
    # Lengths that are multiples of VTK's block of 32768 bytes, and one that is not.
    return {"bytes": (np.arange(n) % 251).astype(np.uint8), "reals": np.sin(np.arange(3.0 * n)).reshape(n, 3)}


CASES = {
    "types.vti": lambda: image((2, 6, -1, 3, 0, 2), every_type, every_type, with_bits=True),
    "flat.vti": lambda: image((0, 6, 0, 4, 3, 3), every_type),
    "blocks.vti": lambda: image((0, 63, 0, 63, 0, 7), large),
    "voxel.vti": lambda: image((0, 0, 0, 0, 0, 0), every_type),
    "mesh.vtu": mesh,
    "poly.vtp": poly,
}


def element(name, array):
    """A <DataArray> in plain text, with the digits that Python thinks right."""
    kind = "Bit" if isinstance(array, vtk.vtkBitArray) else None
    if kind:
        values = np.array([array.GetValue(i) for i in range(array.GetNumberOfTuples())])
    else:
        values = vtk_to_numpy(array)
        kind = next(k for k, dtype in TYPES.items() if values.dtype == dtype)
    text = " ".join(str(x) for x in values.ravel())
    size, count = array.GetNumberOfComponents(), array.GetNumberOfTuples()
    attributes = f'type="{kind}" Name="{name}" NumberOfComponents="{size}" NumberOfTuples="{count}" format="ascii"'
    return f"<DataArray {attributes}>{text}</DataArray>"


def attributes_of(data):
    parts = []
    for tag, attributes in (("PointData", data.GetPointData()), ("CellData", data.GetCellData())):
        arrays = [attributes.GetArray(k) for k in range(attributes.GetNumberOfArrays())]
        parts.append(f"<{tag}>" + "".join(element(a.GetName(), a) for a in arrays) + f"</{tag}>")
    return "".join(parts)


def field_elements(data):
    text = "name: ä\0\0end\0".encode()
    codes = " ".join(str(b) for b in text)
    strings = f'<Array type="String" Name="text" NumberOfTuples="3" format="ascii">{codes}</Array>'
    return f'<FieldData>{strings}{element("TimeValue", data.GetFieldData().GetArray("TimeValue"))}</FieldData>'


def numbers(name, values):
    return f'<DataArray type="Int64" Name="{name}" format="ascii">{" ".join(str(v) for v in values)}</DataArray>'


def cells_of(cells):
    ends = np.cumsum([len(c) for c in cells])
    return numbers("connectivity", [p for c in cells for p in c]) + numbers("offsets", ends)


def point_ids(cell):
    return [cell.GetPointId(p) for p in range(cell.GetNumberOfPoints())]


def reference(data, kind):
    """The data set in plain text, without VTK's writers."""
    if kind == "ImageData":
        extent = " ".join(str(e) for e in data.GetExtent())
        spaces = " ".join(repr(x) for x in data.GetSpacing())
        origin = " ".join(repr(x) for x in data.GetOrigin())
        outer = f'WholeExtent="{extent}" Origin="{origin}" Spacing="{spaces}"'
        piece, body = f'Extent="{extent}"', ""
    else:
        outer, piece = "", f'NumberOfPoints="{data.GetNumberOfPoints()}"'
        body = "<Points>" + element("Points", data.GetPoints().GetData()) + "</Points>"
        if kind == "UnstructuredGrid":
            cells = [data.GetCell(c) for c in range(data.GetNumberOfCells())]
            lists = [point_ids(data.GetCell(c)) for c in range(data.GetNumberOfCells())]
            types = numbers("types", [data.GetCellType(c) for c in range(len(cells))]).replace("Int64", "UInt8")
            piece += f' NumberOfCells="{len(cells)}"'
            body += f"<Cells>{cells_of(lists)}{types}</Cells>"
        else:
            for tag in ("Verts", "Lines", "Polys", "Strips"):
                array = getattr(data, "Get" + tag)()
                ids = vtk.vtkIdList()
                lists = []
                for c in range(array.GetNumberOfCells()):
                    array.GetCellAtId(c, ids)
                    lists.append([ids.GetId(p) for p in range(ids.GetNumberOfIds())])
                piece += f' NumberOf{tag}="{len(lists)}"'
                body += f"<{tag}>{cells_of(lists)}</{tag}>"
    return (
        f'<VTKFile type="{kind}"><{kind} {outer}>{field_elements(data)}'
        f"<Piece {piece}>{body}{attributes_of(data)}</Piece></{kind}></VTKFile>"
    )


def theirs(folder):
    count = 0
    for case, make in CASES.items():
        stem, suffix = case.split(".")
        data = make()
        kind = {"vti": "ImageData", "vtu": "UnstructuredGrid", "vtp": "PolyData"}[suffix]
        (folder / f"{stem}-reference.{suffix}").write_text(reference(data, kind), encoding="utf-8")
        for mode, encoded, compressor, bits_, order in WAYS:
            writer = getattr(vtk, f"vtkXML{kind}Writer")()
            complaints = Complaints(writer)
            way = "-".join([mode, "base64" if encoded else "plain", compressor or "none", str(bits_), order])
            writer.SetFileName(str(folder / f"{stem}-{way}.{suffix}".replace("-plain", "")))
            writer.SetInputData(data)
            getattr(writer, {"ascii": "SetDataModeToAscii", "binary": "SetDataModeToBinary"}.get(mode, "SetDataModeToAppended"))()
            writer.SetEncodeAppendedData(encoded)
            getattr(writer, f"SetCompressorTypeTo{compressor or 'None'}")()
            writer.SetHeaderType(bits_)
            getattr(writer, f"SetByteOrderTo{order}")()
            check(writer.Write() == 1 and not complaints.texts, case, way, *complaints.texts)
            count += 1
    print(count, "files written by VTK", vtk.vtkVersion.GetVTKVersion())


if __name__ == "__main__":
    {"ours": ours, "theirs": theirs}[sys.argv[1]](Path(sys.argv[2]))
