# @TITLE@
# A ParaView state, written by @PROGRAM@ for ParaView 5.11 and later. Three ways to open it:
#
#   in the program      File > Load State..., or   paraview --state=THIS_FILE
#   with a display      pvpython THIS_FILE [FOLDER]
#   without a display   xvfb-run pvbatch THIS_FILE [FOLDER]
#
# The last two write the picture, into FOLDER or else beside this file. The volumes are looked for beside this file
# too, so the folder may be moved or sent away as a whole.

import math
import os
import shutil
import subprocess
import sys

import paraview
paraview.compatibility.major, paraview.compatibility.minor = 5, 11  # newer versions then take the names used here
from paraview.simple import *
from paraview import servermanager
import paraview.simple

# ---------------------------------------------------------------------------------------------- the figure: edit here

# The panels from left to right; files beside this one. A `.pvd` is an animation: a list of volumes with their times.
# Beside volumes there are panels of edges, and of slices; a volume may have edges over it.
PANELS = @PANELS@
# How many frames the animations have, and how many of them a second; None if there is no animation.
FRAMES = @FRAMES@
RATE = @RATE@
# The frames' times in their `.pvd`, if not seconds: of a sequence of slices, where they are.
TIMES = @TIMES@
# 'vti', or 'raw' for float32 triples without a header.
SOURCE = @SOURCE@
# None, ('octant', its corner or None for the middle), or ('plane', 0 to 2 for x to z, position).
CUT = @CUT@
# The picture's name, or None.
SCREENSHOT = @SCREENSHOT@
# The picture's width and height in pixels, or None: as the panels need.
SIZE = @SIZE@
# 'rgba': the colours of the file; 'ambient_occlusion': a colour map from 0, fully occluded, to 1, open.
COLOR_BY = @COLOR_BY@
# Whether a colour bar stands in the last view.
COLORBAR = @COLORBAR@
# How edges are drawn: the array that colours them, hidden parts ('thin', 'leave_out' or 'same'), the radius of tubes
# (None: as fits the picture), and how opaque the skins are that they are drawn over.
TUBES = @TUBES@
# From where the volumes are seen, against the middle of the image; +y is up.
CAMERA = (1.0, 0.72, 1.45)
# The colours of outlines and of text.
LINES = (0.62, 0.62, 0.62)
TEXT = (0.0, 0.0, 0.0)

# ParaView runs the script of a programmable filter among this file's own names, and puts all of numpy's there: `max`,
# `sum`, `split`, `save` ... So Python's own are kept under other names, and what is global here has a name numpy lacks.
largest, smallest, total = max, min, sum

# ------------------------------------------------------------------------------------------------------------- files

try:
    HERE = os.path.dirname(os.path.abspath(__file__))
except NameError:  # pasted into the Python shell
    HERE = os.getcwd()


def stop(message):
    raise RuntimeError(message)


def locate_file(name):
    path = os.path.normpath(os.path.join(HERE, name))
    if not os.path.isfile(path):
        stop('%s is missing: it belongs beside this state, in %s. Run the pipeline again, or move both together.'
             % (name, HERE))
    return path


def setp(proxy, **properties):
    """Sets the properties that this version of ParaView has, and skips the others."""
    known = set(proxy.ListProperties())
    for name, value in properties.items():
        if name in known:
            setattr(proxy, name, value)


def read_vti(panel):
    # A list of parts, or an image.
    kind = XMLPartitionedImageDataReader if panel['file'].endswith('.pvti') else XMLImageDataReader
    reader = kind(registrationName=panel['file'], FileName=[locate_file(panel['file'])])
    setp(reader, TimeArray='None')
    return reader


def read_raw(panel):
    """Numbers without a header: all that describes them is given here."""
    path = locate_file(panel['file'])
    nx, ny, nz = panel['dimensions']
    expected = 12 * nx * ny * nz
    if os.path.getsize(path) != expected:  # ParaView would wait for ever for what a short file lacks
        stop('%s has %d bytes, but %d x %d x %d voxels of three float32 are %d. Run the pipeline again.'
             % (panel['file'], os.path.getsize(path), nx, ny, nz, expected))
    reader = ImageReader(registrationName=panel['file'], FileNames=[path])
    setp(reader, DataScalarType='float', DataByteOrder='LittleEndian', NumberOfScalarComponents=3,
         FileDimensionality='3', FileLowerLeft=1, ScalarArrayName='rgb',
         DataOrigin=panel['origin'], DataSpacing=panel['spacing'])
    if 'DataExtent' in reader.ListProperties():
        reader.DataExtent = [0, nx - 1, 0, ny - 1, 0, nz - 1]
    else:  # since ParaView 6.1
        setp(reader, MinimumIndex=[0, 0, 0], Dimensions=[nx, ny, nz])
    return reader


def is_animation(panel):
    return panel['file'].endswith('.pvd')


def frame_times():
    """The times of the frames; of a figure without animations the one time there is."""
    if TIMES:
        return TIMES
    return [k / RATE for k in range(FRAMES)] if FRAMES else [0.0]


def read_pvd(panel):
    return PVDReader(registrationName=panel['file'], FileName=locate_file(panel['file']))


def read_panel(panel):
    if is_animation(panel):
        reader = read_pvd(panel)
    else:
        reader = read_raw(panel) if SOURCE == 'raw' else read_vti(panel)
    reader.UpdatePipeline()
    extent = reader.GetDataInformation().GetExtent()
    found = [extent[2 * a + 1] - extent[2 * a] + 1 for a in range(3)]
    if found != list(panel['dimensions']):
        stop('%s has %s voxels, but this state was written for %s. Run the pipeline again.'
             % (panel['file'], ' x '.join(map(str, found)), ' x '.join(map(str, panel['dimensions']))))
    return reader


def colour_array(reader, panel):
    """The array that holds the colour."""
    for name in ('rgba', 'rgb'):
        if name in reader.PointData.keys():
            return name
    stop('%s has neither rgba nor rgb: add one of them to the arrays that the pipeline writes.' % panel['file'])


# ------------------------------------------------------------------------------------------------------------ voxels

# A file's points are the centres of its voxels. ParaView draws the boxes *between* points and blends their colours, so
# the same numbers are handed on as cells, of a grid that is one larger and moved by half a voxel; along the axis FLAT,
# which has one layer, the cells stay flat. An array `shown` is added: 1 where a voxel is opaque and not cut away. AWAY
# has, for each axis that the cut is about, the position beyond which voxels go.
VOXELS_EXTENT = '''
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as keys
extent = list(self.GetExecutive().GetInputInformation(0, 0).Get(keys.WHOLE_EXTENT()))
for axis in range(3):
    if FLAT != axis:
        extent[2 * axis + 1] += 1
self.GetExecutive().GetOutputInformation(0).Set(keys.WHOLE_EXTENT(), extent, 6)
'''
VOXELS_REQUEST = '''
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as keys
wanted = self.GetExecutive().GetInputInformation(0, 0)
wanted.Set(keys.UPDATE_EXTENT(), wanted.Get(keys.WHOLE_EXTENT()), 6)
'''
VOXELS_CELLS = '''
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
points, cells = self.GetInputDataObject(0, 0), self.GetOutputDataObject(0)
extent, origin, spacing = list(points.GetExtent()), list(points.GetOrigin()), points.GetSpacing()
arrays = points.GetPointData()
seen = [name for name in ('coverage', 'opacity') if arrays.HasArray(name)]
if seen:
    shown = vtk_to_numpy(arrays.GetArray(seen[0])) >= 0.5
elif arrays.HasArray('rgba'):
    shown = vtk_to_numpy(arrays.GetArray('rgba'))[:, 3] >= 128
else:  # the background alone is pure white
    shown = (vtk_to_numpy(arrays.GetArray('rgb')) < 1.0).any(axis=1)
shown = shown.astype(numpy.uint8)
if AWAY:
    beyond = [slice(None)] * 3
    for axis, position in AWAY:
        first = int(numpy.floor((position - origin[axis]) / spacing[axis])) + 1 - extent[2 * axis]
        beyond[2 - axis] = slice(first if first > 0 else 0, None)
    shown.reshape(points.GetDimensions()[::-1])[tuple(beyond)] = 0
for axis in range(3):
    if FLAT != axis:
        extent[2 * axis + 1] += 1
        origin[axis] -= spacing[axis] / 2
cells.SetExtent(extent)
cells.SetOrigin(origin)
cells.SetSpacing(spacing)
for k in range(arrays.GetNumberOfArrays()):
    cells.GetCellData().AddArray(arrays.GetArray(k))
if FLAT is not None and arrays.HasArray('rgba'):
    # A pixel that is covered in part lets the white ground through: edges without stairs.
    colours = vtk_to_numpy(arrays.GetArray('rgba')).astype(float)
    share = colours[:, 3:] / 255
    colours[:, :3] = colours[:, :3] * share + 255 * (1 - share)
    colours[:, 3] = 255
    blended = numpy_to_vtk((colours + 0.5).astype(numpy.uint8), deep=1)
    blended.SetName('rgba')
    cells.GetCellData().AddArray(blended)
shown = numpy_to_vtk(shown, deep=1)
shown.SetName('shown')
cells.GetCellData().AddArray(shown)
'''


def points_to_cells(source, name, flat=None, away=()):
    """The voxels of an image as cells; with `flat`, an axis with one layer, as squares."""
    given = 'FLAT, AWAY = %r, %r\n' % (flat, list(away))
    f = ProgrammableFilter(registrationName=name, Input=source)
    f.OutputDataSetType = 'vtkImageData'
    f.CopyArrays = 0
    f.RequestInformationScript = given + VOXELS_EXTENT
    f.RequestUpdateExtentScript = VOXELS_REQUEST
    f.Script = given + VOXELS_CELLS
    return f


def shown_cells(cells, name):
    f = Threshold(registrationName=name, Input=cells)
    f.Scalars, f.LowerThreshold, f.UpperThreshold = ['CELLS', 'shown'], 0.5, 2.0
    return f


# What `body_points` found, by the file's name.
POINTS = {}


def body_points(reader, panel):
    """The points (x, y, z) of the opaque voxels, on a coarse grid; of an animation those of some of its frames."""
    if panel['file'] in POINTS:
        return POINTS[panel['file']]
    n = panel['dimensions']
    coarse = ExtractSubset(Input=reader)
    coarse.VOI = [0, n[0] - 1, 0, n[1] - 1, 0, n[2] - 1]
    coarse.SampleRateI, coarse.SampleRateJ, coarse.SampleRateK = [largest(1, k // 40) for k in n]
    cells = points_to_cells(coarse, 'coarse')
    body = shown_cells(cells, 'coarse body')
    centres = CellCenters(Input=body, VertexCells=0)
    moments = frame_times() if is_animation(panel) else [0.0]
    points = []
    for time in moments[::len(moments) // 24 + 1]:
        if is_animation(panel):
            centres.UpdatePipeline(time)
        found = servermanager.Fetch(centres)
        points += [found.GetPoint(k) for k in range(found.GetNumberOfPoints())]
    for proxy in (centres, body, cells, coarse):
        Delete(proxy)
    POINTS[panel['file']] = points
    return points


def frame_over_time(panels, readers):
    """A box around all bodies in all frames, with a little air."""
    points = [point for panel, reader in zip(panels, readers) for point in body_points(reader, panel)]
    if not points:
        return None
    air = [2.0 * largest(1, panels[0]['dimensions'][a] // 40) * panels[0]['spacing'][a] for a in range(3)]
    return [v for a in range(3)
            for v in (smallest(p[a] for p in points) - air[a], largest(p[a] for p in points) + air[a])]


def union_of(boxes):
    return [(smallest if k % 2 == 0 else largest)(b[k] for b in boxes) for k in range(6)]


def middle_of(bounds):
    return [(bounds[2 * a] + bounds[2 * a + 1]) / 2 for a in range(3)]


def grid_bounds(panel):
    """The image with the whole of its outermost voxels."""
    return [v for n, o, s in zip(panel['dimensions'], panel['origin'], panel['spacing'])
            for v in (o - s / 2, o + (n - 0.5) * s)]


# ------------------------------------------------------------------------------------------------------------- views

def make_view(name, parallel):
    v = CreateView('RenderView')
    RenameView(name, v)
    setp(v, UseColorPaletteForBackground=0, BackgroundColorMode='Single Color', Background=[1.0, 1.0, 1.0],
         UseGradientBackground=0, CenterAxesVisibility=0, OrientationAxesVisibility=0, StereoType='Crystal Eyes',
         CameraParallelProjection=int(parallel), UseFXAA=1)
    if parallel:
        setp(v, InteractionMode='2D')
    return v


def place_camera(v, bounds, aspect, above, below=0.0):
    """Moves back along CAMERA until the box fills the view between the shares above and below it, left to text."""
    length = math.sqrt(CAMERA[0] ** 2 + CAMERA[1] ** 2 + CAMERA[2] ** 2)
    back = [c / length for c in CAMERA]
    right = [back[2] / math.hypot(back[0], back[2]), 0.0, -back[0] / math.hypot(back[0], back[2])]
    up = [back[1] * right[2], back[2] * right[0] - back[0] * right[2], -back[1] * right[0]]
    middle = middle_of(bounds)
    corners = []  # in the camera's own axes
    for k in range(8):
        p = [bounds[2 * a + (k >> a & 1)] - middle[a] for a in range(3)]
        corners.append([total(x * y for x, y in zip(p, axis)) for axis in (right, up, back)])
    angle = 24.0
    slope = math.tan(math.radians(angle / 2))
    # Perspective shows the near corners larger, so the box's middle is not the picture's: settle shift and distance.
    away = 4.0 * math.sqrt(total((bounds[2 * a + 1] - bounds[2 * a]) ** 2 for a in range(3)))
    shift = [0.0, 0.0]
    for _ in range(20):
        seen = [[c[a] / ((away - c[2]) * slope) for c in corners] for a in range(2)]
        box = [f(values) for values in seen for f in (smallest, largest)]
        grow = largest((box[1] - box[0]) / (1.86 * aspect), (box[3] - box[2]) / (1.9 - 2.0 * (above + below)))
        away *= grow
        shift = [(box[0] + box[1]) / 2 * slope * away / grow, (box[2] + box[3]) / 2 * slope * away / grow]
    shift[1] += (above - below) * slope * away
    target = [m + shift[0] * r + shift[1] * u for m, r, u in zip(middle, right, up)]
    setp(v, CameraViewAngle=angle, CameraFocalPoint=target, CenterOfRotation=middle, CameraViewUp=[0.0, 1.0, 0.0],
         CameraPosition=[t + away * b for t, b in zip(target, back)], CameraParallelScale=slope * away)


def show_bar(v):
    """The colour bar of ambient occlusion, if wanted: of the colour map, or of how far a colour is darkened."""
    if not COLORBAR:
        return
    bar = GetScalarBar(GetColorTransferFunction('ambient_occlusion'), v)
    size = text_size()
    setp(bar, Title='ambient occlusion A', ComponentTitle='', TitleColor=TEXT, LabelColor=TEXT, TitleFontFamily='Arial',
         LabelFontFamily='Arial', TitleFontSize=size, LabelFontSize=int(0.85 * size), AutomaticLabelFormat=0,
         LabelFormat='%.2f', RangeLabelFormat='%.0f', UseCustomLabels=1, CustomLabels=[0.25, 0.5, 0.75],
         ScalarBarThickness=int(0.7 * size), ScalarBarLength=0.36, Orientation='Horizontal')
    for place in ('Any Location', 'AnyLocation'):
        try:
            bar.WindowLocation = place
            break
        except ValueError:
            pass
    setp(bar, Position=[0.32, 0.015], Visibility=1)


def show_caption(text, v):
    label = Text(registrationName='Caption: ' + text, Text='\n' + text)
    d = Show(label, v, 'TextSourceRepresentation')
    locate_text(d, 'Upper Center')
    setp(d, Color=TEXT, FontSize=text_size(), FontFamily='Arial', Bold=0, Shadow=0)


def locate_text(d, place):
    for name in (place, place.replace(' ', '')):  # as the version of ParaView writes it
        try:
            d.WindowLocation = name
            break
        except ValueError:
            pass


BILLBOARDS = []


def show_label(label, position, v):
    """Text that begins at a point of the scene and always faces the viewer."""
    d = Show(label, v, 'TextSourceRepresentation')
    setp(d, TextPropMode='Billboard 3D Text', BillboardPosition=position, Color=TEXT, FontSize=text_size(),
         FontFamily='Arial', Bold=0, Shadow=0)
    BILLBOARDS.append(d)


def colour_by(d, association, array):
    """Colours a representation as COLOR_BY says; `array` holds the colours that the file gives."""
    mapped = COLOR_BY == 'ambient_occlusion'
    name = COLOR_BY if mapped else array
    d.ColorArrayName = [association, name]
    d.LookupTable = GetColorTransferFunction(name)
    d.MapScalars = int(mapped)


def show_cells(source, v, array, relief):
    """Shows cells in their colours."""
    d = Show(source, v)
    d.SetRepresentationType('Surface')
    colour_by(d, 'CELLS', array)
    setp(d, Ambient=1.0 - relief, Diffuse=relief, Specular=0.0, Interpolation='Flat')
    return d


def place_parallel(v, box, aspect):
    x, y = (box[0] + box[1]) / 2, (box[2] + box[3]) / 2
    half = 0.5 * largest(box[3] - box[2], (box[1] - box[0]) / aspect) * 1.06
    far = 10.0 * largest(half, 1.0)
    setp(v, CameraPosition=[x, y, far], CameraFocalPoint=[x, y, 0.0], CameraViewUp=[0.0, 1.0, 0.0],
         CameraParallelScale=half, CenterOfRotation=[x, y, 0.0])


def show_image(panel, reader, array, v, aspect):
    """An image of one layer, straight on."""
    squares = points_to_cells(reader, os.path.splitext(panel['file'])[0] + ': pixels', flat=2)
    show_cells(squares, v, array, 0.0)
    bounds = grid_bounds(panel)
    room = 0.08 * (bounds[3] - bounds[2])
    place_parallel(v, [bounds[0], bounds[1], bounds[2], bounds[3] + room], aspect)


# -------------------------------------------------------------------------------------------------- edges and slices

# The radius of tubes as a share of the diagonal of what is shown, and of hidden ones as a share of that.
TUBE, THIN = 0.0022, 0.45
PALE, INK = (0.78, 0.78, 0.78), (0.2, 0.2, 0.2)
# What is near is dark; below and above the middle of w there are two hues. Both are told apart in grey too.
RAMPS = {'depth': ((0.0, 0.04, 0.09, 0.27), (0.5, 0.16, 0.42, 0.66), (1.0, 0.68, 0.83, 0.93)),
         'w': ((0.0, 0.05, 0.16, 0.45), (0.5, 0.50, 0.47, 0.48), (1.0, 0.93, 0.56, 0.10))}
# The colours of several slices or objects, from the first on and around again.
TINTS = ((0.55, 0.71, 0.86), (0.96, 0.76, 0.48), (0.66, 0.82, 0.62), (0.90, 0.62, 0.60), (0.76, 0.68, 0.86),
         (0.93, 0.88, 0.55))
# The ranges of what tubes are coloured by, over all panels.
RANGES = {}

# Tints, darkened by ambient occlusion where it is known, and normals that are split at edges.
SLICE_SKIN = '''
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
split = vtkPolyDataNormals()
split.SetInputData(self.GetInputDataObject(0, 0))
split.SetFeatureAngle(40.0)
split.Update()
out = self.GetOutputDataObject(0)
out.ShallowCopy(split.GetOutput())
arrays, count = out.GetPointData(), out.GetNumberOfPoints()
if count:
    number = vtk_to_numpy(arrays.GetArray('object')).astype(int) - 1 if NUMBER is None else numpy.full(count, NUMBER)
    colours = numpy.array(TINTS)[number % len(TINTS)]
    if arrays.HasArray('ambient_occlusion'):
        colours = colours * vtk_to_numpy(arrays.GetArray('ambient_occlusion'))[:, None]
    kept = numpy_to_vtk((255 * numpy.clip(colours, 0, 1) + 0.5).astype(numpy.uint8), deep=1)
    kept.SetName('rgb')
    arrays.AddArray(kept)
'''


def is_volume(panel):
    return 'kind' not in panel


def light_view(v):
    """One white light that goes with the camera, a little above it; ParaView's own three are tinted."""
    v.UseLight = 0
    light = AddLight(view=v)
    setp(light, Coords='Camera', Type='Directional', Position=[-0.25, 0.6, 1.0], FocalPoint=[0.0, 0.0, 0.0],
         Intensity=1.0, DiffuseColor=[1.0, 1.0, 1.0])


def read_polydata(name):
    reader = XMLPolyDataReader(registrationName=name, FileName=[locate_file(name)])
    setp(reader, TimeArray='None')
    reader.UpdatePipeline()
    return reader


def is_filled(source):
    return source.GetDataInformation().GetNumberOfCells() > 0


def tubes_of(lines, name, radius):
    tube = Tube(registrationName=name, Input=lines)
    setp(tube, Scalars=['POINTS', ''], Vectors=['POINTS', ''], NumberofSides=12, Capping=1, Radius=radius)
    return tube


def part_of(reader, name, seen):
    """The lines that are seen, or those that are hidden."""
    part = Threshold(registrationName=name, Input=reader)
    part.Scalars = ['CELLS', 'visible']
    part.LowerThreshold, part.UpperThreshold = (0.5, 1.5) if seen else (-0.5, 0.5)
    lines = ExtractSurface(registrationName=name + ', lines', Input=part)
    lines.UpdatePipeline()
    return lines


def show_tubes(name, box, v):
    """The edges in a file as tubes; returns the array that colours them."""
    reader, stem = read_polydata(name), os.path.splitext(name)[0]
    if not is_filled(reader):
        return None
    radius = TUBES['radius'] or TUBE * math.sqrt(total((box[2 * a + 1] - box[2 * a]) ** 2 for a in range(3)))
    parts = [(reader, '', radius, True)]
    if TUBES['hidden'] != 'same' and 'visible' in reader.CellData.keys():
        parts = [(part_of(reader, stem + ': seen', True), '', radius, True)]
        if TUBES['hidden'] == 'thin':
            parts.append((part_of(reader, stem + ': hidden', False), ', hidden', THIN * radius, False))
    # Stereographic projections have no depth.
    array = TUBES['color_by']
    if array not in reader.PointData.keys():
        array = 'w' if array and 'w' in reader.PointData.keys() else None
    for lines, text, size, seen in parts:
        if not is_filled(lines):
            continue
        d = Show(tubes_of(lines, stem + ': tubes' + text, size), v)
        d.SetRepresentationType('Surface')
        setp(d, Ambient=0.45, Diffuse=0.6, Specular=0.0, Interpolation='Gouraud')
        if array and seen:
            low, high = reader.PointData[array].GetRange()
            before = RANGES.get(array, (low, high))
            RANGES[array] = (smallest(low, before[0]), largest(high, before[1]))
            d.ColorArrayName, d.LookupTable, d.MapScalars = ['POINTS', array], GetColorTransferFunction(array), 1
        else:
            d.ColorArrayName = ['POINTS', '']
            setp(d, AmbientColor=INK if seen else PALE, DiffuseColor=INK if seen else PALE)
    return array


def finish_tubes(shown):
    """The ranges of colours, and a bar in the last panel of each; `shown` has an array and a view for each panel."""
    for array, (low, high) in RANGES.items():
        if not high > low:
            low, high = low - 0.5, high + 0.5
        points = [v for x, r, g, b in RAMPS[array] for v in (low + x * (high - low), r, g, b)]
        setp(GetColorTransferFunction(array), AutomaticRescaleRangeMode='Never', ColorSpace='RGB', RGBPoints=points,
             ScalarRangeInitialized=1.0)
        v = [view for name, view in shown if name == array][-1]
        bar, size = GetScalarBar(GetColorTransferFunction(array), v), text_size()
        setp(bar, Title=array, ComponentTitle='', TitleColor=TEXT, LabelColor=TEXT, TitleFontFamily='Arial',
             LabelFontFamily='Arial', TitleFontSize=size, LabelFontSize=int(0.85 * size), AutomaticLabelFormat=0,
             HorizontalTitle=1, LabelFormat='%.2f', RangeLabelFormat='%.2f', UseCustomLabels=1,
             CustomLabels=[(low + high) / 2], ScalarBarThickness=int(0.6 * size), ScalarBarLength=0.25,
             Orientation='Vertical')
        for place in ('Any Location', 'AnyLocation'):
            try:
                bar.WindowLocation = place
                break
            except ValueError:
                pass
        setp(bar, Position=[0.8, 0.06], Visibility=1)


def show_edges(panel, box, v, aspect):
    """A panel of edges alone; flat ones straight on."""
    if box is None:
        reader = read_polydata(panel['file'])
        box = list(reader.GetDataInformation().GetBounds()) if is_filled(reader) else [-1.0, 1.0] * 3
        Delete(reader)
    light_view(v)
    array = show_tubes(panel['file'], box, v)
    if is_image(panel):
        place_parallel(v, [box[0], box[1], box[2], box[3] + 0.08 * (box[3] - box[2])], aspect)
    else:
        place_camera(v, box, aspect, 0.05)
    return array


def bounds_over_time(reader):
    """A box around all frames; none if nothing is in them."""
    boxes = []
    for time in frame_times():
        reader.UpdatePipeline(time)
        if is_filled(reader):
            boxes.append(list(reader.GetDataInformation().GetBounds()))
    reader.UpdatePipeline(frame_times()[0])
    return union_of(boxes) if boxes else None


def has_occlusion(reader):
    return 'ambient_occlusion' in reader.PointData.keys()


def show_slices_alone(panel, v, aspect):
    """Surfaces that lie in one space. Several have a colour each, and are cut open as CUT says to show the inside.

    A sequence that is played has one at a time, with its place below.
    """
    light_view(v)
    if is_animation(panel):
        readers = [read_pvd(panel)]
        filled, box = [(0, readers[0])], bounds_over_time(readers[0])
        place = AnnotateTimeFilter(registrationName=panel['file'] + ': place', Input=readers[0])
        setp(place, Format='at {time:.3g}')
        d = Show(place, v, 'TextSourceRepresentation')
        locate_text(d, 'Lower Center')
        setp(d, Color=TEXT, FontSize=text_size(), FontFamily='Arial', Bold=0, Shadow=0)
    else:
        readers = [read_polydata(name) for name in panel['files']]
        filled = [(k, reader) for k, reader in enumerate(readers) if is_filled(reader)]
        box = union_of([reader.GetDataInformation().GetBounds() for _, reader in filled]) if filled else None
    if box is None:
        return
    for k, reader in filled:
        name = os.path.splitext(panel['files'][k])[0]
        skin = ProgrammableFilter(registrationName=name + ': skin', Input=reader)
        skin.Script = 'NUMBER, TINTS = %r, %r\n' % (k if len(readers) > 1 else None, TINTS) + SLICE_SKIN
        shown = skin
        if CUT is not None and len(readers) > 1:
            shown = Clip(registrationName=name + ': cut', Input=skin)
            centre = middle_of(box)
            if CUT[0] == 'plane':
                centre[CUT[1]] = CUT[2]
                shown.ClipType = 'Plane'
                setp(shown.ClipType, Origin=centre, Normal=[float(a == CUT[1]) for a in range(3)])
                setp(shown, Invert=1)
            else:
                shown.ClipType = 'Box'
                centre = list(CUT[1]) if CUT[1] is not None else centre
                length = [1.02 * largest(box[2 * a + 1] - centre[a], 0.0) + 1e-6 for a in range(3)]
                setp(shown.ClipType, UseReferenceBounds=0, Position=centre, Translation=centre, Length=length)
                setp(shown, Invert=0, Exact=1)
            HideInteractiveWidgets(shown.ClipType)
        d = Show(shown, v)
        d.SetRepresentationType('Surface')
        if COLOR_BY == 'ambient_occlusion' and has_occlusion(reader):
            colour_by(d, 'POINTS', 'rgb')
        else:
            d.ColorArrayName, d.LookupTable, d.MapScalars = ['POINTS', 'rgb'], GetColorTransferFunction('rgb'), 0
        setp(d, Ambient=0.5, Diffuse=0.5, Specular=0.0, Interpolation='Gouraud')
        if box[5] == box[4]:  # outlines of 3D scenes
            setp(d, LineWidth=3.0)
    place_camera(v, box, aspect, 0.05)


@LOOK@# ------------------------------------------------------------------------------------------------------------ figure

def is_image(panel):
    return 'dimensions' in panel and panel['dimensions'][2] == 1


def panel_grid():
    """Columns and rows of panels."""
    columns = len(PANELS) if len(PANELS) <= 3 else int(math.ceil(math.sqrt(len(PANELS))))
    return columns, -(-len(PANELS) // columns)


def picture_size():
    """SIZE, or as many pixels as fit the panels' shapes, within what a display or a page holds."""
    if SIZE:
        return list(SIZE)
    columns, rows = panel_grid()
    width = panel_width(columns)
    heights = []
    for panel in PANELS:
        if is_image(panel):
            b = grid_bounds(panel)
            heights.append(width * 1.08 * (b[3] - b[2]) / (b[1] - b[0]))
        else:
            heights.append(width * TALL)
    height = smallest(largest(largest(heights), 0.3 * width), 2.0 * width)
    return [width * columns, rows * int(height + 0.5)]


def layout_size():
    """The size on a display; the picture has the same shape, and its text grows with it."""
    size = picture_size()
    return size if size[0] <= 1600 else [1600, int(1600.0 * size[1] / size[0] + 0.5)]


def text_size():
    """The height of text on a display, so that captions fit their panels."""
    return int(largest(6, smallest(24, layout_size()[0] / panel_grid()[0] / 26.0)))


def split_cell(layout, cell, parts, horizontally):
    """Splits a cell of the layout into equal parts, and returns them from the left or from the top."""
    cells = []
    while parts > 1:
        first = (layout.SplitHorizontal if horizontally else layout.SplitVertical)(cell, 1.0 / parts)
        cells.append(first)
        cell, parts = first + 1, parts - 1
    return cells + [cell]


# Inferno, which is even to the eye, also in grey: position, red, green, blue.
INFERNO = ((0.0, 0.001, 0.000, 0.014), (0.125, 0.122, 0.048, 0.282), (0.25, 0.342, 0.062, 0.429),
           (0.375, 0.550, 0.134, 0.412), (0.5, 0.736, 0.216, 0.330), (0.625, 0.890, 0.349, 0.203),
           (0.75, 0.978, 0.557, 0.035), (0.875, 0.976, 0.802, 0.171), (1.0, 0.988, 0.998, 0.645))
GREY = ((0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0))


def prepare_colours():
    """Fixed ranges, so that two volumes can be compared; no fog in `rgba`."""
    points = INFERNO if COLOR_BY == 'ambient_occlusion' else GREY
    setp(GetColorTransferFunction('ambient_occlusion'), AutomaticRescaleRangeMode='Never', ColorSpace='RGB',
         RGBPoints=[v for point in points for v in point], ScalarRangeInitialized=1.0)
    setp(GetColorTransferFunction('rgba'), AutomaticRescaleRangeMode='Never')
    setp(GetOpacityTransferFunction('rgba'), ScalarRangeInitialized=1,
         Points=[v for x, y in ((0.0, 0.0), (127.0, 0.0), (128.0, 1.0), (255.0, 1.0)) for v in (x, y, 0.5, 0.0)])


def centre_of(panels, readers):
    """Where the volumes are cut and sliced, unless CUT says otherwise: half of what is in them lies on either side.

    The middle of their bounds could fall between two bodies; this layer always goes through one of them.
    """
    points = [point for panel, reader in zip(panels, readers) for point in body_points(reader, panel)]
    if points:
        centre = [sorted(point[a] for point in points)[(len(points) - 1) // 2] for a in range(3)]
    else:
        centre = middle_of(grid_bounds(panels[0]))
    for a in range(3):  # on to the next face between voxels, so that no rounding decides what is cut off
        o, s = panels[0]['origin'][a], panels[0]['spacing'][a]
        centre[a] = o + (math.floor((centre[a] - o) / s + 0.5) + 0.5) * s
    if CUT is not None and CUT[0] == 'octant' and CUT[1] is not None:
        centre = list(CUT[1])
    if CUT is not None and CUT[0] == 'plane':
        centre[CUT[1]] = CUT[2]
    return centre


def prepare_time():
    """Lets ParaView play the frames, and shows the first."""
    scene = GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    setp(scene, PlayMode='Snap To TimeSteps')
    scene.AnimationTime = frame_times()[0]


def build_figure():
    """Builds the layout; returns it and the picture's size."""
    if not PANELS:
        stop('this state has no volume to show')
    columns, rows = panel_grid()
    size = picture_size()
    shape = (size[0] / columns) / (size[1] / rows)

    prepare_colours()
    readers = [read_panel(panel) for panel in PANELS if is_volume(panel)]
    if FRAMES and readers:
        prepare_time()
    volumes = [panel for panel in PANELS if is_volume(panel)]
    arrays = [colour_array(reader, panel) for reader, panel in zip(readers, volumes)]
    layout = CreateLayout(name='Figure')
    cells = [cell for row in split_cell(layout, 0, rows, False) for cell in split_cell(layout, row, columns, True)]
    views = []
    for panel, cell in zip(PANELS, cells):
        views.append(make_view(panel['caption'] or panel['file'], is_image(panel)))
        AssignViewToLayout(view=views[-1], layout=layout, hint=cell)
    of_volumes = [v for panel, v in zip(PANELS, views) if is_volume(panel)]
    everything = list(zip(volumes, readers, arrays, of_volumes))
    solids = [one for one in everything if not is_image(one[0])]
    for panel, reader, array, v in everything:
        if is_image(panel):
            show_image(panel, reader, array, v, shape)
    box, seen = None, []
    if solids:
        panels, files, colours, seen = [list(column) for column in zip(*solids)]
        box = show_solids(panels, files, colours, seen, centre_of(panels, files), shape)
        for panel, v in zip(panels[1:], seen[1:]):  # turning one volume turns them all
            AddCameraLink(seen[0], v, 'camera of ' + (panel['caption'] or panel['file']))
        SetActiveView(seen[0])
    tubes = []
    for panel, v in zip(PANELS, views):
        if 'edges' in panel:
            around = grid_bounds(panel) if is_image(panel) else box
            tubes.append((show_tubes(panel['edges'], around, v), v))
        elif not is_volume(panel) and panel['kind'] == 'edges':
            own = 'dimensions' in panel
            around = (grid_bounds(panel) if is_image(panel) else box) if own else None
            tubes.append((show_edges(panel, around, v, shape), v))
            if own and seen and not is_image(panel):
                AddCameraLink(seen[0], v, 'camera of ' + (panel['caption'] or panel['file']))
        elif not is_volume(panel):
            show_slices_alone(panel, v, shape)
    if TIMES:  # the sequences are known now
        prepare_time()
    finish_tubes(tubes)
    for panel, v in zip(PANELS, views):
        if panel['caption']:
            show_caption(panel['caption'], v)
    show_bar(views[-1])
    layout.SetSize(layout_size())
    if readers:
        SetActiveSource(readers[0])
    return layout, size


def save_picture(layout, size):
    folder = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else HERE
    target = os.path.normpath(os.path.join(folder, SCREENSHOT))
    if not os.path.isdir(os.path.dirname(target)):
        os.makedirs(os.path.dirname(target))
    for d in BILLBOARDS:  # of all text only these do not grow with the picture
        setp(d, FontSize=int(text_size() * size[0] / layout_size()[0] + 0.5))
    stem = os.path.splitext(target)[0]
    for k, time in enumerate(frame_times()):
        name = '%s_%04d.png' % (stem, k) if FRAMES else target
        if FRAMES:
            GetAnimationScene().AnimationTime = time
        SaveScreenshot(name, layout, ImageResolution=size, SeparatorWidth=0, SeparatorColor=[1.0, 1.0, 1.0],
                       FontScaling='Scale fonts proportionally')
        print('wrote ' + name)
        if FRAMES and k == 0:
            shutil.copyfile(name, target)
            print('wrote ' + target)
    if FRAMES:
        make_film(stem)


def make_film(stem):
    """A film of the frames, where ffmpeg is installed; else a line that says how it is made."""
    film, unfinished = stem + '.mp4', stem + '.partial.mp4'
    command = ['ffmpeg', '-y', '-loglevel', 'error', '-framerate', repr(RATE),
               '-i', stem.replace('%', '%%') + '_%04d.png', '-frames:v', str(FRAMES),
               '-vf', 'pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white', '-pix_fmt', 'yuv420p']
    if shutil.which('ffmpeg') is None:
        print('ffmpeg is not installed; with it, this makes a film of the frames:')
        print('  ' + ' '.join("'%s'" % part.replace("'", "'\\''") for part in command + [film]))
        return
    if subprocess.call(command + [unfinished]) == 0:
        os.replace(unfinished, film)
        print('wrote ' + film)
    else:
        if os.path.exists(unfinished):
            os.remove(unfinished)
        print('ffmpeg failed; the frames are there')


paraview.simple._DisableFirstRenderCameraReset()
FIGURE = build_figure()
if __name__ == '__main__' and SCREENSHOT is not None:  # under pvbatch and pvpython, not in the program
    save_picture(*FIGURE)
