# ------------------------------------------------------------------------------------------------- the look: voxels
#
# Each voxel is drawn as a small box in its own colour, without a colour map and without fog. The upper view of a volume
# is cut open where CUT says; there the faces of the boxes are dimmed a little by their direction (RELIEF) so that the
# eye can tell them apart. The lower view shows three slices, in exactly the colours of the file.

# How much the faces of voxels are dimmed by their direction; 0: not at all.
RELIEF = 0.3
# The share of a panel's height that its slices take.
SLICES = 0.3
# The height of a volume's panel as a multiple of its width.
TALL = 1.25


def panel_width(columns):
    return smallest(800, 3200 // columns)


def cut_away(centre):
    """What AWAY says above."""
    if CUT is None:
        return []
    return [(CUT[1], CUT[2])] if CUT[0] == 'plane' else list(enumerate(centre))


def new_label(text):
    return Text(registrationName='Label: ' + text, Text=text)


def show_lines(source, v):
    d = Show(source, v)
    d.SetRepresentationType('Wireframe')
    d.ColorArrayName = [None, '']
    setp(d, AmbientColor=LINES, DiffuseColor=LINES, Ambient=1.0, Diffuse=0.0, LineWidth=1.0)


def show_boxes(panel, reader, array, centre, v):
    name = os.path.splitext(panel['file'])[0]
    cells = points_to_cells(reader, name + ': voxels', away=cut_away(centre))
    show_cells(shown_cells(cells, name + ': cut open'), v, array, RELIEF)
    # One white light that goes with the camera, a little above it; ParaView's own three are tinted.
    v.UseLight = 0
    light = AddLight(view=v)
    setp(light, Coords='Camera', Type='Directional', Position=[-0.25, 0.6, 1.0], FocalPoint=[0.0, 0.0, 0.0],
         Intensity=1.0, DiffuseColor=[1.0, 1.0, 1.0])
    bounds = grid_bounds(panel)
    frame = Box(registrationName=name + ': frame', Center=middle_of(bounds),
                XLength=bounds[1] - bounds[0], YLength=bounds[3] - bounds[2], ZLength=bounds[5] - bounds[4])
    show_lines(Outline(registrationName=name + ': outline', Input=frame), v)
    out = 0.05 * largest(bounds[2 * a + 1] - bounds[2 * a] for a in range(3))
    x, y, z = middle_of(bounds)
    show_label(new_label('x'), [x, bounds[2] - 1.6 * out, bounds[5] + out], v)
    show_label(new_label('y'), [bounds[0] - 1.6 * out, y, bounds[5]], v)
    show_label(new_label('z'), [bounds[1] + out, bounds[2] - out, z], v)
    if array == 'rgba':  # ready for who prefers ParaView's own volume rendering: click on the reader's eye
        d = Show(reader, v, 'UniformGridRepresentation')
        d.SetRepresentationType('Volume')
        d.ColorArrayName = ['POINTS', 'rgba']
        d.LookupTable = GetColorTransferFunction('rgba')
        d.ScalarOpacityFunction = GetOpacityTransferFunction('rgba')
        setp(d, MapScalars=0, ScalarOpacityUnitDistance=smallest(panel['spacing']), VolumeRenderingMode='Smart',
             Shade=0)
        Hide(reader, v)


def turned_slice(panel, reader, axis, index, move):
    """One layer of voxels, turned to face the viewer."""
    name = '%s: %s slice' % (os.path.splitext(panel['file'])[0], 'xyz'[axis])
    n = panel['dimensions']
    layer = ExtractSubset(registrationName=name, Input=reader)
    layer.VOI = [v for a in range(3) for v in ((index, index) if a == axis else (0, n[a] - 1))]
    turned = Transform(registrationName=name + ', turned', Input=points_to_cells(layer, name + ', squares', flat=axis))
    setp(turned, TransformAllInputVectors=0)  # three numbers a voxel are a colour here, no direction to be turned
    turned.Transform.Rotate = ([0.0, 90.0, 0.0], [-90.0, 0.0, 0.0], [0.0, 0.0, 0.0])[axis]
    turned.Transform.Translate = move
    HideInteractiveWidgets(turned.Transform)
    return turned


def show_slices(panel, reader, array, centre, v, aspect):
    """The layers at the centre side by side: xy, xz, and zy, the first letter to the right and the second up."""
    name = os.path.splitext(panel['file'])[0]
    bounds, n = grid_bounds(panel), panel['dimensions']
    edge = [bounds[2 * a + 1] - bounds[2 * a] for a in range(3)]
    gap = 0.12 * largest(edge)
    left, top = 0.0, largest(edge[1], edge[2])
    turned = []
    for axis, right, up in ((2, 0, 1), (1, 0, 2), (0, 2, 1)):
        o, s = panel['origin'][axis], panel['spacing'][axis]
        index = smallest(largest(int(math.floor((centre[axis] - o) / s + 1e-9)), 0), n[axis] - 1)
        at = o + index * s
        # After the turn the image's axes `right` and `up` lie along x and y, and `axis` along z, or against it.
        move = [left - bounds[2 * right], (top - edge[up]) / 2 - bounds[2 * up], -at if axis == 2 else at]
        turned.append(turned_slice(panel, reader, axis, index, move))
        text = '%.2f' % at
        text = '%s%s,  %s = %s' % ('xyz'[right], 'xyz'[up], 'xyz'[axis], '0.00' if text == '-0.00' else text)
        show_label(new_label(text),
                   [left, (top - edge[up]) / 2 - 0.13 * top, 0.0], v)
        left += edge[right] + gap
    together = AppendDatasets(registrationName=name + ': slices', Input=turned)
    show_cells(together, v, array, 0.0)
    surface = ExtractSurface(registrationName=name + ': slices, surface', Input=together)
    frames = FeatureEdges(registrationName=name + ': slices, frames', Input=surface)
    setp(frames, BoundaryEdges=1, FeatureEdges=0, NonManifoldEdges=0, ManifoldEdges=0, Coloring=0)
    show_lines(frames, v)
    place_parallel(v, [0.0, left - gap, -0.2 * top, top], aspect)


def show_solids(panels, readers, arrays, views, centre, shape):
    """The volumes, and slices below each."""
    layout = GetLayout(views[0])
    whole = union_of([grid_bounds(panel) for panel in panels])
    for panel, reader, array, v in zip(panels, readers, arrays, views):
        s = make_view('Slices: ' + (panel['caption'] or panel['file']), True)
        cell = layout.SplitVertical(layout.GetViewLocation(v), 1.0 - SLICES)
        AssignViewToLayout(view=s, layout=layout, hint=cell + 1)
        show_boxes(panel, reader, array, centre, v)
        place_camera(v, whole, shape / (1.0 - SLICES), 0.07)
        show_slices(panel, reader, array, centre, s, shape / SLICES)
    return whole


