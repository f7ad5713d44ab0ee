"""Walks through ParaView's plugin as a user would; prints what came out as JSON. Run by pvbatch: PLUGIN FOLDER."""

import inspect
import json
import os
import subprocess
import sys

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec

from paraview.simple import *
from vtkmodules.numpy_interface import dataset_adapter as dsa
from vtkmodules.vtkCommonCore import vtkFileOutputWindow, vtkOutputWindow

plugin, folder = sys.argv[1:3]
log = os.path.join(folder, "messages.txt")
window = vtkFileOutputWindow()
window.SetFileName(log)
window.FlushOn()
vtkOutputWindow.SetInstance(window)
LoadPlugin(plugin, ns=globals())
pipeline = os.path.join(folder, "pipeline.yaml")
out = {}


started, start = [], subprocess.Popen


def counted(*arguments, **keys):
    started.append(arguments)
    return start(*arguments, **keys)


subprocess.Popen = counted


def update(proxy, when=None):
    """Updates it; returns how often the program was started for that."""
    before = len(started)
    proxy.UpdatePipeline() if when is None else proxy.UpdatePipeline(when)
    return len(started) - before


def arrays(proxy):
    data = dsa.WrapDataObject(servermanager.Fetch(proxy)).PointData
    # JSON has no infinity, which is the depth of nothing.
    return {name: [float(x) if abs(x) < 1e30 else -1.0 for x in data[name].reshape(-1)[:: max(1, data[name].size // 1000)]] for name in data.keys()}


def told(read=[0]):
    """What was said since it was asked last."""
    text = open(log).read() if os.path.exists(log) else ""
    new, read[0] = text[read[0] :], len(text)
    return new


picture = ao4dPicture(FileName=pipeline)
first = update(picture)
out["picture"] = {"dimensions": picture.GetDataInformation().DataInformation.GetExtent(), "arrays": arrays(picture)}
again = update(picture)
picture.TurnXW = 30.0
picture.Distance = 2.0
turned = update(picture)
out["turned"] = arrays(picture)
picture.TurnXW = 0.0
picture.Distance = 1.0
picture.Picture = "plain"
picture.Voxels = 6
update(picture)
out["plain"] = {"dimensions": picture.GetDataInformation().DataInformation.GetExtent()}
picture.Picture = ""
picture.Voxels = 0
picture.Method = "exact"
picture.Supersample = 1
picture.Tolerance = 0.05
picture.Set = "render.shading=smooth; with.dilate=0"
update(picture)
out["exact"] = arrays(picture)
out["started"] = [first, again, turned]
out["told"] = told()

picture.Set = "render.shadin=smooth"
update(picture)
out["refused"] = told()
picture.Program = "/no/such/program"
update(picture)
out["no program"] = told()

slice = ao4dSlice(FileName=pipeline, W=0.5)
update(slice)
out["slice"] = {"bounds": slice.GetDataInformation().GetBounds(), "arrays": sorted(arrays(slice))}

film = ao4dFilm(FileName=pipeline, Plane="xw", Frames=4, Voxels=8)
film.UpdatePipelineInformation()
out["film"] = {"times": list(film.TimestepValues), "frames": []}
for when in film.TimestepValues:
    update(film, when)
    out["film"]["frames"].append(sum(arrays(film)["opacity"]))

four = XMLUnstructuredGridReader(FileName=[os.path.join(folder, "mesh.vtu")])
occlusion = ao4dOcclusion(Input=four, Samples=64)
update(occlusion)
out["four"] = {"arrays": arrays(occlusion), "given": arrays(four)}

box = Box()
solid = ao4dOcclusion(Input=Wavelet(WholeExtent=[0, 3, 0, 3, 0, 3]), Isovalue=150.0)
update(solid)
out["image"] = {"bounds": solid.GetDataInformation().GetBounds(), "points": solid.GetDataInformation().GetNumberOfPoints()}
solid = ao4dOcclusion(Input=AppendDatasets(Input=[box, Sphere(Center=[0.9, 0, 0])]))
update(solid)
out["three"] = arrays(solid)

series = PVDReader(FileName=os.path.join(folder, "series.pvd"))
spacetime = ao4dOcclusion(Input=series, Isovalue=0.5, TimeScale=2.0, Samples=16)
update(spacetime)
out["spacetime w"] = float(dsa.WrapDataObject(servermanager.Fetch(spacetime)).PointData["position"][:, 3].max())
out["spacetime cells"] = spacetime.GetDataInformation().GetNumberOfCells()
solid = ao4dOcclusion(Input=four, FourthCoordinate="nothing")
update(solid)
out["no array"] = told()
json.dump(out, open(os.path.join(folder, "plugin.json"), "w"))
