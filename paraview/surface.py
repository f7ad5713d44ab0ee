# ------------------------------------------------------------------------------------------------ the look: surfaces
#
# Of each volume four sources stand in the pipeline browser: the file; its bodies, as solids whose skin runs where half
# of a voxel is covered, one an object where the file tells objects apart; what is left of them beyond the cut, a clip
# whose box or plane may be dragged; and the smooth skin of that. The frame's edges are those behind the bodies.

# The width of the kernel that smooths skin and colours, in voxels. Empty voxels have no part in colours.
SMOOTH = 0.7
# What the kernel leaves of a rod one voxel thick is 0.325 at its middle: with so many times that its skin has the same
# cross-section.
BOLDER = 2.1
# Faces that meet at a larger angle, in degrees, meet at a sharp edge.
EDGE_ANGLE = 40.0
# How often normals are averaged.
ROUNDS = 8
# How much of the light comes from all sides; the rest comes from above the camera. A colour map is dimmed less.
CALM = 0.62 if COLOR_BY == 'rgba' else 0.8
# The height of a volume's panel as a multiple of its width.
TALL = 0.94

BODIES_REQUEST = VOXELS_REQUEST
BODIES_GRID = '''
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkRectilinearGrid
from vtkmodules.vtkFiltersCore import vtkAppendFilter
from vtkmodules.vtkFiltersGeneral import vtkTableBasedClipDataSet
image, arrays = self.GetInputDataObject(0, 0), self.GetInputDataObject(0, 0).GetPointData()
shape = image.GetDimensions()[::-1]

def array_of(name, *components):
    found = arrays.GetArray(name)
    return None if found is None else vtk_to_numpy(found).reshape(shape + components)

# What is covered, in what colour, by which object.
# Where light passes objects, the file tells what is covered apart from what is opaque.
rgba, colours, opacity = array_of('rgba', 4), array_of('rgb', 3), array_of('coverage')
if opacity is None:
    opacity = array_of('opacity')
occlusion, number = array_of('ambient_occlusion'), array_of('object')
if opacity is None:  # of a .raw file the background alone is pure white
    opacity = rgba[..., 3] / numpy.float32(255) if rgba is not None else (colours < 1).any(axis=3)
opacity = opacity.astype(numpy.float32)
colours = rgba[..., :3].astype(numpy.float32) if rgba is not None else colours * numpy.float32(255)
if number is None:
    number = numpy.ones(shape, numpy.uint16)
values = [colours[..., k] for k in range(3)]
if occlusion is not None:
    values.append(occlusion)

# One layer more on each side, half a voxel away and equal to the last: a body that goes on beyond the image is cut
# off by its border, flat.
ticks = []
for axis in range(3):
    n, o, s = image.GetDimensions()[axis], image.GetOrigin()[axis], image.GetSpacing()[axis]
    o += s * image.GetExtent()[2 * axis]
    ticks.append(numpy.concatenate([[o - s / 2], o + s * numpy.arange(n), [o + (n - 0.5) * s]]))

def blurred(a, width):
    reach = int(3 * width + 1)
    weights = numpy.exp(-0.5 * (numpy.arange(-reach, reach + 1) / width) ** 2).astype(numpy.float32)
    weights /= weights.sum()
    for axis in range(3):
        if a.shape[axis] < 3:
            continue
        around = [(reach, reach) if k == axis else (0, 0) for k in range(3)]
        wide, n = numpy.pad(a, around, mode='edge'), a.shape[axis]
        part = lambda k: wide[tuple(slice(k, k + n) if q == axis else slice(None) for q in range(3))]
        a = part(0) * weights[0]
        for k in range(1, 2 * reach + 1):
            a += part(k) * weights[k]
    return a

def pairs(a, both, before):
    # Of each voxel and the next one (or the one before) along every axis: both, or one of them.
    for axis in range(3):
        if a.shape[axis] < 2:
            continue
        n = a.shape[axis]
        wide = numpy.pad(a, [(1, 1) if k == axis else (0, 0) for k in range(3)], mode='edge')
        part = lambda k: wide[tuple(slice(k, k + n) if q == axis else slice(None) for q in range(3))]
        a = both(part(1), part(0 if before else 2))
    return a

def thin(a):
    # What belongs to no block of 2 x 2 x 2 voxels.
    return a & ~pairs(pairs(a, numpy.logical_and, False), numpy.logical_or, True)

def add_array(grid, name, a):
    kept = numpy_to_vtk(numpy.ascontiguousarray(a), deep=1)
    kept.SetName(name)
    grid.GetPointData().AddArray(kept)

together = vtkAppendFilter()
for one in numpy.unique(number[opacity > 0]):
    of_it = (number == one) & (opacity > 0)
    around = []
    for axis in range(3):
        filled = numpy.flatnonzero(of_it.any(axis=tuple(k for k in range(3) if k != axis)))
        around.append(slice(int(numpy.maximum(filled[0] - 4, 0)), int(filled[-1]) + 5))
    around = tuple(around)
    covered = numpy.where(of_it[around], opacity[around], numpy.float32(0))
    smooth = blurred(covered, SMOOTH)
    # What is less than two voxels thick, as rods, sheets and sharp edges are, is drawn bolder; what would be lost even
    # so stays as it is.
    slight = thin(covered >= 0.5)
    skin = numpy.maximum(smooth, BOLDER * blurred(numpy.where(slight, covered, numpy.float32(0)), SMOOTH))
    kept = pairs(pairs(skin >= 0.5, numpy.logical_or, False), numpy.logical_or, True)
    skin = numpy.where(slight & ~kept, covered, skin)
    weight = numpy.maximum(smooth, 1e-6)
    spread = [blurred(covered * v[around], SMOOTH) / weight for v in values]

    # Cropped to the object, with the border's layers where the image ends.
    at = [(around[2 - axis].start, int(numpy.minimum(around[2 - axis].stop, shape[2 - axis]))) for axis in range(3)]
    edges = [(int(first == 0), int(behind == shape[2 - axis])) for axis, (first, behind) in enumerate(at)]
    closed = lambda a: numpy.pad(a, edges[::-1], mode='edge').ravel()
    grid = vtkRectilinearGrid()
    grid.SetDimensions([behind - first + sum_of[0] + sum_of[1] for (first, behind), sum_of in zip(at, edges)])
    for axis, give in enumerate((grid.SetXCoordinates, grid.SetYCoordinates, grid.SetZCoordinates)):
        (first, behind), (before, after) = at[axis], edges[axis]
        give(numpy_to_vtk(ticks[axis][first + 1 - before:behind + 1 + after].copy(), deep=1))
    add_array(grid, 'covered', closed(skin))
    three = numpy.stack([closed(v) for v in spread[:3]], axis=1)
    add_array(grid, 'rgb', numpy.clip(three + 0.5, 0, 255).astype(numpy.uint8))
    if occlusion is not None:
        add_array(grid, 'ambient_occlusion', closed(spread[3]))
    add_array(grid, 'object', numpy.full(closed(skin).size, one, numpy.int32))
    grid.GetPointData().SetActiveScalars('covered')
    solid = vtkTableBasedClipDataSet()
    solid.SetInputData(grid)
    solid.SetValue(0.5)
    solid.Update()
    if solid.GetOutput().GetNumberOfCells() > 0:
        solid.GetOutput().GetPointData().RemoveArray('covered')
        together.AddInputData(solid.GetOutput())
if together.GetNumberOfInputConnections(0) > 0:
    together.Update()
    self.GetOutputDataObject(0).ShallowCopy(together.GetOutput())
'''

# Normals of the skin, split at sharp edges. Coverage comes in steps, so a flat face that is almost along the voxels has
# ripples of a few hundredths of a voxel, which light would show: normals are averaged over neighbours, but not across
# edges.
SMOOTH_NORMALS = '''
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
split = vtkPolyDataNormals()
split.SetInputData(self.GetInputDataObject(0, 0))
split.SetFeatureAngle(EDGE_ANGLE)
split.SplittingOn()
split.ConsistencyOn()
split.Update()
out = self.GetOutputDataObject(0)
out.ShallowCopy(split.GetOutput())
if out.GetNumberOfPolys() > 0:
    corners = vtk_to_numpy(out.GetPolys().GetConnectivityArray())
    starts = vtk_to_numpy(out.GetPolys().GetOffsetsArray())
    of_cell = numpy.repeat(numpy.arange(starts.size - 1), numpy.diff(starts))
    points = vtk_to_numpy(out.GetPoints().GetData()).astype(float)
    normals = vtk_to_numpy(out.GetPointData().GetNormals()).astype(float)

    def sums(which, values, count):
        return numpy.stack([numpy.bincount(which, values[:, k], count) for k in range(3)], axis=1)

    # Each corner's triangle with the first corner of its cell, twice its area.
    a, b, c = (points[corners[starts[:-1] + k]] for k in range(3))
    area = numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1)
    for _ in range(ROUNDS):
        around = sums(of_cell, normals[corners], starts.size - 1) * area[:, None]
        normals = sums(corners, around[of_cell], len(points)) + 1e-12 * normals
        normals /= numpy.maximum(numpy.linalg.norm(normals, axis=1), 1e-300)[:, None]
    kept = numpy_to_vtk(numpy.ascontiguousarray(normals, numpy.float32), deep=1)
    kept.SetName('Normals')
    out.GetPointData().SetNormals(kept)
'''


def panel_width(columns):
    return (1280 if FRAMES else 3200) // columns


def bodies_of(reader, name):
    f = ProgrammableFilter(registrationName=name + ': bodies', Input=reader)
    f.OutputDataSetType = 'vtkUnstructuredGrid'
    f.CopyArrays = 0
    f.RequestUpdateExtentScript = BODIES_REQUEST
    f.Script = 'SMOOTH, BOLDER = %r, %r\n' % (SMOOTH, BOLDER) + BODIES_GRID
    return f


def cut_open(bodies, name, centre, bounds):
    """What is left beyond the cut: a clip whose box or plane may be dragged."""
    if CUT is None:
        return bodies
    clip = Clip(registrationName=name + ': cut', Input=bodies)
    if CUT[0] == 'plane':
        clip.ClipType = 'Plane'
        setp(clip.ClipType, Origin=[centre[a] if a == CUT[1] else middle_of(bounds)[a] for a in range(3)],
             Normal=[float(a == CUT[1]) for a in range(3)])
        setp(clip, Invert=1)
    else:
        clip.ClipType = 'Box'
        beyond = 0.02 * largest(bounds[2 * a + 1] - bounds[2 * a] for a in range(3))
        length = [largest(bounds[2 * a + 1] - centre[a], 0.0) + beyond for a in range(3)]
        setp(clip.ClipType, UseReferenceBounds=0, Position=centre, Translation=centre, Length=length)
        setp(clip, Invert=0, Exact=1)
    HideInteractiveWidgets(clip.ClipType)
    return clip


def link_cuts(clips):
    """Dragging one cut drags them all."""
    for k, other in enumerate(clips[1:]):
        link = servermanager.vtkSMProxyLink()
        for a, b in ((clips[0], other), (other, clips[0])):
            link.AddLinkedProxy(a.ClipType.SMProxy, 1)
            link.AddLinkedProxy(b.ClipType.SMProxy, 2)
        servermanager.ProxyManager().RegisterLink('cut %d' % (k + 2), link)


def smooth_skin(solid, name):
    skin = ExtractSurface(registrationName=name + ': skin', Input=solid)
    f = ProgrammableFilter(registrationName=name + ': smooth skin', Input=skin)
    f.Script = 'EDGE_ANGLE, ROUNDS = %r, %r\n' % (EDGE_ANGLE, ROUNDS) + SMOOTH_NORMALS
    return f


def frame_of(solids):
    """A box around all bodies, with a little air."""
    boxes = [solid.GetDataInformation().GetBounds() for solid in solids
             if solid.GetDataInformation().GetNumberOfCells() > 0]
    if not boxes:
        return None
    box = union_of(boxes)
    air = 0.04 * largest(box[2 * a + 1] - box[2 * a] for a in range(3))
    return [v + (air if k % 2 else -air) for k, v in enumerate(box)]


def show_frame(box, labels, v):
    """The edges of the frame that lie behind the bodies, from wherever one looks, and the names of the axes."""
    setp(v.AxesGrid, Visibility=1, UseCustomBounds=1, CustomBounds=box, XTitle='', YTitle='', ZTitle='',
         CullFrontface=1, CullBackface=0, ShowGrid=0, ShowEdges=1, ShowTicks=0, GridColor=LINES, AxesToLabel=0,
         XAxisUseCustomLabels=1, YAxisUseCustomLabels=1, ZAxisUseCustomLabels=1,
         XAxisLabels=[], YAxisLabels=[], ZAxisLabels=[])
    out = 0.035 * largest(box[2 * a + 1] - box[2 * a] for a in range(3))
    x, y, z = middle_of(box)
    places = ([x, box[2] - 1.6 * out, box[5] + out], [box[0] - 1.6 * out, y, box[5]], [box[1] + out, box[2] - out, z])
    for label, place in zip(labels, places):
        show_label(label, place, v)


def show_solids(panels, readers, arrays, views, centre, shape):
    """The bodies in all volumes, seen from the same place in the same light."""
    names = [os.path.splitext(panel['file'])[0] for panel in panels]
    bodies = [bodies_of(reader, name) for reader, name in zip(readers, names)]
    for body in bodies:
        body.UpdatePipeline()
    box = frame_over_time(panels, readers) if FRAMES else frame_of(bodies)
    box = box or union_of([grid_bounds(panel) for panel in panels])
    cuts = [cut_open(body, name, centre, box) for body, name in zip(bodies, names)]
    if CUT is not None:
        link_cuts(cuts)
    labels = [Text(registrationName='axis ' + axis, Text=axis) for axis in 'xyz']
    for panel, cut, name, v in zip(panels, cuts, names, views):
        d = Show(smooth_skin(cut, name), v)
        d.SetRepresentationType('Surface')
        colour_by(d, 'POINTS', 'rgb')
        setp(d, Ambient=CALM, Diffuse=1.0 - CALM, Specular=0.0, Interpolation='Gouraud')
        if 'edges' in panel:
            setp(d, Opacity=TUBES['skin'])
        light_view(v)
        show_frame(box, labels, v)
        place_camera(v, box, shape, 0.05, 0.06 if COLORBAR else 0.0)
    return box


