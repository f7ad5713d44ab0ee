"""Whether `ao4d info` reads images as the libraries do that write them: value for value, and place for place.

    check_images.py AO4D FOLDER

Writes files by nibabel, pynrrd, tifffile, netCDF4, VTK and SimpleITK into FOLDER, reads each by its library and by AO4D, and compares all values
and where the corners lie. Prints how many files there were; exits with 1 and a message at the first thing that is wrong.
"""

import itertools
import json
import subprocess
import sys
from pathlib import Path

import netCDF4
import nibabel
import nrrd
import numpy as np
import SimpleITK
import tifffile
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

AO4D, FOLDER = sys.argv[1], Path(sys.argv[2])
SIZES = (9, 8, 7, 5)
RANDOM = np.random.default_rng(4)
TYPES = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]


def check(condition, *message):
    if not condition:
        sys.exit("check_images: " + " ".join(str(m) for m in message))


def field(kind="float32", sizes=SIZES):
    """Values with x first."""
    values = RANDOM.normal(size=sizes) * 50
    return np.clip(values, 0, None).astype(kind) if kind.startswith("u") else values.astype(kind)


def ours(path, array=None):
    """What AO4D says of a file, and its values with x first."""
    values = FOLDER / "values.f64"
    options = ["--array", array] if array else []
    run = subprocess.run([AO4D, "info", path, "--json", "--values", values, *options], capture_output=True, text=True)
    check(run.returncode == 0, path, run.stderr)
    told = json.loads(run.stdout)
    by_role = {axis["role"]: axis for axis in told["axes"]}
    sizes = [by_role[role]["points"] if role in by_role else 1 for role in ("x", "y", "z", "time")]
    if told["kind"] == "image" and not told["point_arrays"]:
        sizes[:3] = [max(n - 1, 1) for n in sizes[:3]]  # values in the cells between the points
    return told, np.fromfile(values, "<f8").reshape(sizes, order="F")


def corner(told, ends):
    """Where a corner lies: for x, y and z 0 is the first point, 1 the last."""
    place = np.zeros(4)
    place[: len(told["origin"])] = told["origin"]
    for axis, end in zip("xyz", ends):
        axis = next(a for a in told["axes"] if a["role"] == axis)
        unit = np.array(axis["direction"] or np.eye(4)["xyz".index(axis["role"])])
        place += unit * (axis["last"] if end else axis["first"])
    return place[:3]


def same(path, values, affine=None, array=None):
    """Holds AO4D against values with x first (masked ones are none), and against a matrix from indices to the world."""
    told, found = ours(path, array)
    expected = np.ma.filled(np.ma.asarray(values, "f8"), np.nan)
    expected = expected.reshape(expected.shape + (1,) * (4 - expected.ndim))
    check(found.shape == expected.shape, path, found.shape, "not", expected.shape)
    wrong = ~np.isclose(found, expected, rtol=1e-6, atol=1e-6, equal_nan=True)
    check(not wrong.any(), path, wrong.sum(), "values differ, the first", found[wrong][:1], "not", expected[wrong][:1])
    if affine is not None:
        for ends in itertools.product((0, 1), repeat=3):
            index = [end * (n - 1) for end, n in zip(ends, expected.shape)]
            there = affine[:3, :3] @ index + affine[:3, 3]
            check(np.allclose(corner(told, ends), there, atol=1e-3), path, ends, corner(told, ends), "not", there)
    return told


def positions(told, role):
    axis = next(a for a in told["axes"] if a["role"] == role)
    return axis["first"], axis["last"], axis["unit"]


COUNT = 0


def name(ending):
    global COUNT
    COUNT += 1
    return FOLDER / f"{COUNT}{ending}"


def oblique(flip=1.0, shear=0.0):
    a, b = 0.3, -0.7
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    turn = turn @ np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    affine = np.eye(4)
    affine[:3, :3] = turn @ np.diag([2.0 * flip, 3.0, 4.0])
    affine[0, 1] += shear
    affine[:3, 3] = [-90, 126.5, -72]
    return affine


for kind in TYPES:
    for family, ending in ((nibabel.Nifti1Image, ".nii"), (nibabel.Nifti1Image, ".nii.gz"), (nibabel.Nifti2Image, ".nii")):
        for affine in (np.diag([-2.0, 3, 4, 1]), oblique(), oblique(-1.0), oblique(shear=0.5)):
            path = name(ending)
            image = family(field(kind), affine)
            image.header.set_xyzt_units("mm", "sec")
            image.header["pixdim"][4] = 1.5
            if not affine[0, 1] == 0.0 and np.isclose(np.abs(np.linalg.det(affine)), 24.0):
                image.set_sform(None, 0)
                image.set_qform(affine, 1)
            nibabel.save(image, path)
            read = nibabel.load(path)
            told = same(path, read.get_fdata(), read.affine)
            check(positions(told, "time") == (0, 6, "s"), path, positions(told, "time"))
path = name(".nii")
image = nibabel.Nifti1Image(field("int16"), oblique())
image.header.set_slope_inter(0.25, -3)
nibabel.save(image, path)
same(path, nibabel.load(path).get_fdata(), oblique())
path = name(".nii")
nibabel.save(nibabel.Nifti1Image(field("float32", (4, 3, 2)), oblique()), path)
same(path, nibabel.load(path).get_fdata(), oblique())
path = name(".img")
nibabel.save(nibabel.Nifti1Pair(field(), oblique()), path)
same(path.with_suffix(".hdr"), nibabel.load(path).get_fdata(), oblique())

for kind, encoding, space in itertools.product(TYPES, ("raw", "gzip", "ASCII"), ("left-posterior-superior", "RAS")):
    for ending in (".nrrd", ".nhdr"):
        path, affine = name(ending), oblique(-1.0)
        header = {
            "space": space,
            "space directions": [*affine[:3, :3].T, [np.nan] * 3],
            "space origin": affine[:3, 3],
            "kinds": ["domain", "domain", "domain", "time"],
            "encoding": encoding,
        }
        nrrd.write(str(path), field(kind), header, detached_header=ending == ".nhdr")
        values, header = nrrd.read(str(path))
        check(header["space"] == space, header)
        affine[:3, :3] = header["space directions"][:3].T
        affine[:3, 3] = header["space origin"]
        told = same(path, values, affine)
        check(told["space"] == ("RAS" if space == "RAS" else "LPS"), path, told["space"])
path = name(".nrrd")
nrrd.write(str(path), field(sizes=(5, 9, 8, 7)), {"kinds": ["time", "domain", "domain", "domain"], "spacings": [3, 1, 2, 4]})
same(path, np.moveaxis(nrrd.read(str(path))[0], 0, -1), np.diag([1.0, 2, 4, 1]))

for kind in TYPES:
    stack = field(kind).T  # t, z, y, x
    path = name(".tif")
    tifffile.imwrite(path, stack, photometric="minisblack", metadata={"axes": "TZYX"})
    same(path, tifffile.imread(path).T)
    for byte_order in "<>":
        path = name(".tif")
        tifffile.imwrite(path, stack, photometric="minisblack", byteorder=byte_order, bigtiff=byte_order == ">")
        same(path, tifffile.imread(path).T)
    path = name(".ome.tif")
    meta = {"axes": "TZYX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 1.0, "PhysicalSizeZ": 2.0, "TimeIncrement": 3.0}
    tifffile.imwrite(path, stack, photometric="minisblack", metadata=meta)
    told = same(path, tifffile.imread(path).T, np.diag([0.5, 1, 2, 1]))
    check(positions(told, "time") == (0, 12, "s"), path, positions(told, "time"))
    path = name(".ome.tif")
    tifffile.imwrite(path, np.moveaxis(stack, 0, 1), photometric="minisblack", metadata={"axes": "ZTYX"})
    same(path, np.moveaxis(tifffile.imread(path), 0, 1).T)
for kind in ("uint8", "uint16", "float32"):
    path, stack = name(".tif"), field(kind).T
    meta = {"axes": "TZYX", "spacing": 3.0, "finterval": 0.5, "unit": "um"}
    tifffile.imwrite(path, stack, imagej=True, resolution=(2, 4), metadata=meta)
    told = same(path, tifffile.imread(path).T, np.diag([0.5, 0.25, 3, 1]))
    check(positions(told, "time")[1] == 2, path, positions(told, "time"))
path = name(".tif")
tifffile.imwrite(path, field("uint8").T, photometric="minisblack", tile=(16, 16), metadata={"axes": "TZYX"})
same(path, tifffile.imread(path).T)
path = name(".tif")
tifffile.imwrite(path, field("uint8").T, photometric="miniswhite", metadata={"axes": "TZYX"})
same(path, tifffile.imread(path).T)

PACKINGS = itertools.cycle(
    [
        {},
        {"compression": "zlib", "shuffle": True, "chunksizes": (2, 3, 4, 5)},
        {"compression": "zlib", "complevel": 9, "shuffle": False, "fletcher32": True},
        {"contiguous": True},
        {"chunksizes": (1, 2, 7, 3), "endian": "big"},
        {"compression": "zlib", "shuffle": True, "endian": "big"},
    ]
)


def packing(form, growing):
    """How NetCDF-4 keeps values: each way in turn."""
    options = next(PACKINGS) if form.startswith("NETCDF4") else {}
    if "chunksizes" in options:
        options = {**options, "chunksizes": tuple(min(n, 5) for n in options["chunksizes"])}
    return {k: v for k, v in options.items() if not (growing and k == "contiguous")}


for form in ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA", "NETCDF4_CLASSIC", "NETCDF4"):
    small = ["i1", "i2", "i4", "f4", "f8"] + (["u1", "u2", "u4", "i8"] if form in ("NETCDF3_64BIT_DATA", "NETCDF4") else [])
    for kind, growing, order in itertools.product(small, (False, True), ("tzyx", "xyzt")):
        if growing and order != "tzyx":
            continue
        path = name(".nc")
        with netCDF4.Dataset(path, "w", format=form) as file:
            for axis, size in zip("xyzt", SIZES):
                file.createDimension(axis, None if growing and axis == "t" else size)
            for axis, size, attribute in zip("xyzt", SIZES, ("degrees_east", "degrees_north", "hPa", "days since 2000-01-01")):
                place = file.createVariable(axis, "f8", (axis,))
                place.units = attribute
                place[:] = 10 + 2.0 * np.arange(size) ** (1 if axis != "z" else 2)
            variable = file.createVariable("f", kind, tuple(order), **packing(form, growing))
            file.createVariable("other", "i1", ("t",))[:] = np.arange(SIZES[3])
            values = field(np.dtype(kind).name if kind[0] != "u" else f"uint{8 * int(kind[1])}")
            values = values.T if order == "tzyx" else values
            if kind in ("i2", "i4"):
                variable.scale_factor, variable.add_offset = 0.5, 3.0
                variable.set_auto_scale(False)
                variable.valid_range = np.array([-80, 90], kind)
            if kind == "i1":
                variable.setncattr("_Unsigned", "true")
                variable.set_auto_scale(False)
            if kind in ("f4", "f8"):
                variable.missing_value = np.array([7, 8], kind)
                values.flat[3], values.flat[4] = 7, 8
            if kind == "i1":
                values = np.abs(values)
            variable[:] = values
            if kind in ("f4", "i2") and not growing:
                variable[0, 0] = netCDF4.default_fillvals[kind]
        with netCDF4.Dataset(path) as file:
            values = file["f"][:]
            told = same(path, values.T if order == "tzyx" else values, array="f")
            for role, axis in zip(("x", "y", "z", "time"), "xyzt"):
                places = file[axis][:]
                check(positions(told, role)[:2] == (places[0], places[-1]), path, role, positions(told, role))

# NetCDF-4: a group, a variable that is shorter than its growing dimension, one with a dimension's name that isn't its coordinates.
path = name(".nc")
with netCDF4.Dataset(path, "w") as file:
    group = file.createGroup("run").createGroup("one")
    for axis, size in zip("tzyx", SIZES[::-1]):
        group.createDimension(axis, None if axis == "t" else size)
    longer = group.createVariable("other", "f4", ("t",))
    longer[:] = np.arange(SIZES[3] + 2)
    group.createVariable("f", "f4", tuple("tzyx"), compression="zlib")[:] = field().T
    group.createVariable("x", "f8", ("x",))[:] = 3 + 0.5 * np.arange(SIZES[0])
with netCDF4.Dataset(path) as file:
    values = file["run/one/f"][:]
    check(values.shape[0] == SIZES[3] + 2 and values.mask[-1].all(), "netCDF4 no longer fills what is short")
    told = same(path, values.T, array="run/one/f")
    check(positions(told, "x")[:2] == (3, 3 + 0.5 * (SIZES[0] - 1)), path, positions(told, "x"))


# VTK.
def image_of(values, direction=None, cells=False):
    data = vtk.vtkImageData()
    data.SetExtent(*(e for i, n in enumerate(values.shape[:3]) for e in (i - 1, i - 2 + n + cells)))
    data.SetOrigin(-1, 2.5, 7)
    data.SetSpacing(0.5, 2, 3)
    if direction is not None:
        data.SetDirectionMatrix(*direction.ravel())
    array = numpy_to_vtk(values.ravel(order="F"), deep=True)
    array.SetName("f")
    (data.GetCellData() if cells else data.GetPointData()).AddArray(array)
    return data


def world_of(data, cells=False):
    """The matrix from indices, counted from 0, to the world."""
    affine = np.eye(4)
    first = np.array(data.GetExtent()[::2]) + (0.5 if cells else 0)
    place = [0.0, 0.0, 0.0]
    data.TransformContinuousIndexToPhysicalPoint(*first, place)
    affine[:3, 3] = place
    for axis in range(3):
        there = [0.0, 0.0, 0.0]
        data.TransformContinuousIndexToPhysicalPoint(*(first + np.eye(3)[axis]), there)
        affine[:3, axis] = np.array(there) - affine[:3, 3]
    return affine


def vtk_read(reader, path, cells=False):
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    values = vtk_to_numpy((data.GetCellData() if cells else data.GetPointData()).GetArray("f"))
    sizes = [n - 1 if cells else n for n in data.GetDimensions()]
    return values.reshape(sizes, order="F"), world_of(data, cells)


for kind, mode, cells in itertools.product(("uint8", "int16", "float32", "float64"), (0, 1, 2), (False, True)):
    path = name(".vti")
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image_of(field(kind, SIZES[:3]), oblique()[:3, :3] @ np.diag([1 / 2, 1 / 3, 1 / 4]), cells))
    writer.SetDataMode(mode)
    writer.Write()
    told = same(path, *vtk_read(vtk.vtkXMLImageDataReader(), path, cells), array="f") if not cells else None
    if cells:
        same(path, vtk_read(vtk.vtkXMLImageDataReader(), path, True)[0])
for kind, mode in itertools.product(("uint8", "int16", "float32", "float64"), (1, 2)):
    path = name(".vtk")
    writer = vtk.vtkStructuredPointsWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image_of(field(kind, SIZES[:3])))
    writer.SetFileType(mode)
    writer.Write()
    same(path, *vtk_read(vtk.vtkStructuredPointsReader(), path))
for pieces, cells in ((2, False), (5, False), (4, True)):
    path = name(".pvti")
    source = vtk.vtkTrivialProducer()
    source.SetOutput(image_of(field("float32", SIZES[:3]), cells=cells))
    source.SetWholeExtent(source.GetOutputDataObject(0).GetExtent())
    writer = vtk.vtkXMLPImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetNumberOfPieces(pieces)
    writer.SetStartPiece(0)
    writer.SetEndPiece(pieces - 1)
    writer.SetInputConnection(source.GetOutputPort())
    check(writer.Write() == 1, path, "can't be written")
    values, affine = vtk_read(vtk.vtkXMLPImageDataReader(), path, cells)
    same(path, values, None if cells else affine)

# Lists over time, with their steps in any order.
steps, times = [], [4.0, 0.5, 1.0]
for time in times:
    path = name(".vti")
    data = image_of(field("float32", SIZES[:3]))
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    writer.Write()
    steps.append((time, path, vtk_read(vtk.vtkXMLImageDataReader(), path)))
ordered = [values for _, _, (values, _) in sorted(steps, key=lambda step: step[0])]
listed = [
    (".pvd", "<VTKFile type='Collection'><Collection>%s</Collection></VTKFile>", "<DataSet timestep='%s' file='%s'/>", ""),
    (".vti.series", '{"file-series-version": "1.0", "files": [%s]}', '{"time": %s, "name": "%s"}', ","),
]
for ending, whole, one, between in listed:
    path = name(ending)
    path.write_text(whole % between.join(one % (time, file.name) for time, file, _ in steps))
    told = same(path, np.stack(ordered, -1), steps[0][2][1])
    axis = next(a for a in told["axes"] if a["role"] == "time")
    check((axis["first"], axis["last"], axis["even"]) == (0.5, 4.0, False), path, axis)


# ITK, which turns everything to the left, the back and up (LPS).
def itk_world(image):
    affine = np.eye(4)
    affine[:3, 3] = image.TransformIndexToPhysicalPoint([0] * image.GetDimension())[:3]
    for axis in range(3):
        step = [int(i == axis) for i in range(image.GetDimension())]
        affine[:3, axis] = np.array(image.TransformIndexToPhysicalPoint(step)[:3]) - affine[:3, 3]
    return affine


for ending, dimension, kind in itertools.product((".nii", ".nii.gz", ".nrrd", ".nhdr", ".vtk"), (3, 4), TYPES):
    if ending == ".vtk" and dimension == 4:
        continue
    values = field(kind, SIZES[:dimension])
    image = SimpleITK.GetImageFromArray(values.T.copy(), isVector=False)
    image.SetSpacing([0.5, 2.0, 3.0, 1.5][:dimension])
    image.SetOrigin([-1.0, 2.5, 7.0, 0.0][:dimension])
    if ending != ".vtk":
        direction = np.eye(dimension)
        direction[:3, :3] = oblique()[:3, :3] @ np.diag([1 / 2, 1 / 3, 1 / 4])
        image.SetDirection(direction.ravel())
    path = name(ending)
    SimpleITK.WriteImage(image, str(path))
    read = SimpleITK.ReadImage(str(path))
    affine = itk_world(read)
    if ending.startswith(".nii"):
        affine = np.diag([-1.0, -1, 1, 1]) @ affine
    same(path, SimpleITK.GetArrayFromImage(read).T, affine)
for kind in ("uint8", "uint16", "float32"):
    path = name(".tif")
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(field(kind, SIZES[:3]).T.copy()), str(path))
    same(path, SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(path))).T)

print(COUNT)
