"""Ambient occlusion in four dimensions.

A scene is made of tetrahedra in R^4 (or of triangles in R^3); a picture of it is a volume of voxels (or of pixels). From
arrays to a picture::

    import numpy as np, ao4d

    mesh = ao4d.Mesh(vertices, tetrahedra)               # (n, 4) and (m, 4)
    found = ao4d.occlusion(mesh, samples=256)            # found.values, found.errors
    picture = ao4d.render(mesh, found, dimensions=[64, 64, 64], camera={"eye": [0, 0, 0, 2]})
    picture.to_pyvista().plot(...)

Whatever a pipeline's stage takes, `occlusion` and `render` take by the same names; `ao4d.schema()` lists them. Of ambient
occlusion 1 is open and 0 fully occluded.

While something is computed, other Python threads run, Ctrl-C raises KeyboardInterrupt, and a bar shows how far it is, in
notebooks and on terminals. `progress=False` shows none; a function is called with (stage, done, total).
"""

from __future__ import annotations

import json as _json
import os as _os
import warnings as _warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _native
from ._native import PipelineError, WorkError, __version__
from ._progress import watching as _watching

__all__ = [
    "Comparison", "Mesh", "Object", "Occlusion", "Picture", "PipelineError", "Report", "WorkError", "__version__", "check",
    "compare", "info", "load_scene", "occlusion", "read_image", "render", "run", "schema",
]

PathLike = Union[str, "_os.PathLike[str]"]
Pipeline = Union[PathLike, Mapping[str, Any]]
Progress = Union[None, bool, Callable[[str, int, int], None]]

#: The arrays that a picture has unless others are asked for.
ARRAYS = ("rgba", "ambient_occlusion", "opacity", "object")


@dataclass
class Object:
    """A part of a mesh: vertices of D coordinates each, and simplices of D vertices each, counted from 0."""

    vertices: Any
    simplices: Any
    name: Optional[str] = None
    #: Red, green and blue, 0 to 1.
    color: Sequence[float] = (0.8, 0.8, 0.8)
    #: The share of light that each surface of it keeps; below 1 light passes.
    opacity: float = 1.0
    #: Where neighbours' normals differ by more, in degrees, a vertex is split; None: nowhere.
    crease_angle: Optional[float] = 30.0
    #: An eye that its surfaces are turned to; None: as the order of vertices says, closed ones outwards.
    facing: Optional[Sequence[float]] = None


class Mesh:
    """A scene: one object, given by its arrays, or several.

    Coordinates are kept as float32. A vertex where the surface creases becomes several, one a side of the crease; the new
    ones stand behind those of the object, with the same coordinates, so `vertices` may have more rows than were given.
    """

    def __init__(self, vertices: Any, simplices: Any, **keys: Any) -> None:
        self._native = _build([Object(vertices, simplices, **keys)])
        self._arrays: Optional[tuple] = None

    @classmethod
    def of(cls, objects: Iterable[Object]) -> "Mesh":
        """A mesh of several objects."""
        return cls._wrap(_build(list(objects)))

    @classmethod
    def _wrap(cls, native: "_native.Mesh") -> "Mesh":
        mesh = cls.__new__(cls)
        mesh._native, mesh._arrays = native, None
        return mesh

    def _array(self, place: int) -> np.ndarray:
        if self._arrays is None:
            self._arrays = self._native.arrays()
            for array in self._arrays:
                array.flags.writeable = False
        return self._arrays[place]

    @property
    def dimension(self) -> int:
        """3 or 4."""
        return self._native.dimension

    @property
    def vertices(self) -> np.ndarray:
        """(n, D) float32."""
        return self._array(0)

    @property
    def normals(self) -> np.ndarray:
        """(n, D) float32: unit normals."""
        return self._array(1)

    @property
    def simplices(self) -> np.ndarray:
        """(m, D) uint32."""
        return self._array(2)

    @property
    def object(self) -> np.ndarray:
        """(n,) uint16: the number of the object that a vertex belongs to, from 1."""
        return self._array(3)

    @property
    def names(self) -> list:
        """What the objects are called."""
        return [name for name, _, _ in self._native.objects()]

    @property
    def closed(self) -> bool:
        """Whether all objects are closed."""
        return all(closed for _, closed, _ in self._native.objects())

    def __repr__(self) -> str:
        objects = self._native.objects()
        return f"<ao4d.Mesh in {self.dimension}D: {len(objects)} objects, {len(self.vertices)} vertices, {len(self.simplices)} simplices>"


def _build(objects: Sequence[Object]) -> "_native.Mesh":
    if not objects:
        raise PipelineError("a mesh has at least one object")
    rows = []
    for number, one in enumerate(objects, 1):
        name = one.name or f"object {number}"
        vertices = np.ascontiguousarray(one.vertices, dtype=np.float64)
        given = np.asarray(one.simplices)
        if vertices.ndim != 2 or given.ndim != 2:
            raise PipelineError(f"{name}: expected tables of vertices and simplices, found {vertices.ndim} and {given.ndim} dimensions")
        if given.size and given.dtype.kind not in "iu":
            raise PipelineError(f"{name}: simplices are whole numbers of vertices, found {given.dtype}")
        if given.size and (int(given.min()) < 0 or int(given.max()) >= len(vertices)):
            wrong = int(given.min()) if int(given.min()) < 0 else int(given.max())
            raise PipelineError(f"{name}: vertex {wrong} does not exist; there are {len(vertices)}, counted from 0")
        crease = -1.0 if one.crease_angle is None else float(one.crease_angle)
        facing = None if one.facing is None else [float(x) for x in one.facing]
        color = [float(x) for x in one.color]
        rows.append((name, vertices, np.ascontiguousarray(given, dtype=np.uint32), color, float(one.opacity), crease, facing))
    return _native.Mesh.build(rows[0][1].shape[1], rows)


@dataclass
class Occlusion:
    """Ambient occlusion at the vertices of a mesh."""

    #: One a vertex, 1 open, 0 fully occluded.
    values: np.ndarray
    #: The standard error of each; 0 where it is exact.
    errors: np.ndarray
    #: Rays in all.
    rays: int = 0
    #: How it was computed; pictures trace rays of their own by it.
    keys: dict = field(default_factory=dict)

    @property
    def error(self) -> float:
        """The root mean square of the errors that are known."""
        known = self.errors[~np.isnan(self.errors)].astype(np.float64)
        return float(np.sqrt(np.mean(known**2))) if known.size else 0.0

    def __repr__(self) -> str:
        return f"<ao4d.Occlusion of {len(self.values)} vertices, mean {self.values.mean():.4f}, error {self.error:.1e}, {self.rays} rays>"


@dataclass
class Picture:
    """An image: of a 4D scene a volume, of a 3D scene one layer."""

    #: Points along x, y and z: the camera's right, up and over.
    dimensions: tuple
    origin: tuple
    spacing: tuple
    #: Each of one row a point, x fastest, as VTK has them.
    arrays: dict
    #: RMS and largest error of its occlusion, and at how many voxels they were measured; None where they weren't.
    accuracy: Optional[tuple] = None
    notes: list = field(default_factory=list)

    def __getitem__(self, name: str) -> np.ndarray:
        """An array by [z, y, x] (and component); it shares the memory of `arrays[name]`."""
        if name not in self.arrays:
            raise KeyError(f"{name}; there are {', '.join(self.arrays)}")
        array = self.arrays[name]
        return array.reshape(tuple(reversed(self.dimensions)) + array.shape[1:])

    def to_pyvista(self) -> Any:
        """As PyVista's ImageData, which shares the memory of the arrays."""
        import pyvista

        image = pyvista.ImageData(dimensions=self.dimensions, spacing=self.spacing, origin=self.origin)
        for name, array in self.arrays.items():
            image.point_data.set_array(array, name)
        return image

    def __repr__(self) -> str:
        size = " x ".join(str(n) for n in self.dimensions)
        return f"<ao4d.Picture of {size} voxels: {', '.join(self.arrays)}>"


@dataclass
class Report:
    """What a run did."""

    #: The output folder.
    out: Path
    #: Its files, in the order they were made.
    files: list
    #: Those of them that were there already, from the same inputs.
    cached: list
    notes: list
    seconds: float
    #: For each stage its name, its seconds, and more about the work.
    stages: list

    def picture(self, name: Optional[str] = None) -> Picture:
        """One of its `.vti` files; the last one if no name is given."""
        images = [file for file in self.files if file.suffix == ".vti" and name in (None, file.name, file.stem)]
        if not images:
            known = ", ".join(file.name for file in self.files)
            raise KeyError(f"no image {name or ''}; there are {known}")
        return read_image(images[-1])


@dataclass
class Comparison:
    """How far two things are apart; true if they are the same within the tolerances."""

    same: bool
    #: What else differs: arrays that one of the two lacks, dimensions, places.
    differences: list
    #: For each array its name, count, how many differ, the largest and the RMS difference, and where.
    arrays: list

    def __bool__(self) -> bool:
        return self.same


def _source(pipeline: Pipeline) -> tuple:
    """The text, if it is one, and the path, or what messages call it."""
    if isinstance(pipeline, Mapping):
        return _json.dumps(pipeline), "pipeline"
    if isinstance(pipeline, str) and "\n" in pipeline:
        return pipeline, "pipeline"
    return None, _os.fspath(pipeline)


def _sets(changes: Optional[Mapping[str, Any]]) -> list:
    """Overrides, as the command line's --set has them. None takes a key out."""
    return [f"{key}=" + ("" if value is None else _json.dumps(_plain(value))) for key, value in (changes or {}).items()]


def _plain(value: Any) -> Any:
    """Numpy's numbers and arrays, tuples and paths as JSON has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, _os.PathLike):
        return _os.fspath(value)
    return value


def _stages(mesh: Mesh, *stages: Mapping[str, Any], seed: int = 0) -> str:
    """A pipeline whose scene stands for the mesh that is there."""
    # Whether light passes some object decides what methods there are, so the stand-in tells that too.
    opacity = min(opacity for _, _, opacity in mesh._native.objects())
    scene = {"scene": {"dimension": mesh.dimension, "objects": [{**_STAND_IN[mesh.dimension], "opacity": opacity}]}}
    return _json.dumps({"name": "memory", "seed": seed, "stages": [scene, *(_plain(stage) for stage in stages)]})


_STAND_IN = {3: {"sphere": {"radius": 1, "subdivisions": 0}}, 4: {"tesseract": {}}}


def load_scene(pipeline: Pipeline, set: Optional[Mapping[str, Any]] = None, progress: Progress = None) -> Mesh:
    """The mesh of a pipeline's first scene: any of its shapes, files and isosurfaces."""
    with _watching(progress) as watch:
        native, notes = _native.Mesh.scene(*_source(pipeline), _sets(set), watch)
    for note in notes:
        _warnings.warn(note, stacklevel=2)
    return Mesh._wrap(native)


def occlusion(mesh: Mesh, *, threads: Optional[int] = None, progress: Progress = None, **keys: Any) -> Occlusion:
    """Ambient occlusion at the vertices of a mesh.

    Keys are those of a pipeline's `occlusion`: method="sobol" (or "random", "adaptive", "exact", ...), samples=256, or
    target_error=0.005 with max_samples; max_distance; seed.
    """
    # A file that nobody writes: an occlusion without one, and without a picture, would be warned of.
    text = _stages(mesh, {"occlusion": {"file": "values.f32", **keys}})
    with _watching(progress) as watch:
        return Occlusion(*_native.occlusion(mesh._native, text, threads, watch), keys)


def render(
    mesh: Mesh,
    occlusion: Union[Occlusion, Mapping[str, Any], None, bool] = None,
    *,
    arrays: Sequence[str] = ARRAYS,
    threads: Optional[int] = None,
    progress: Progress = None,
    **keys: Any,
) -> Picture:
    """A picture of a mesh.

    `occlusion` is what `ao4d.occlusion` found, or the keys that it takes, or False for none. Keys are those of a pipeline's
    `render`: dimensions=[64, 64, 64], camera={"eye": ..., "target": ..., "field_of_view": ...}, shading="auto",
    tolerance=0.01, supersample, dilate, lights, sky, ...
    """
    settings = occlusion.keys if isinstance(occlusion, Occlusion) else occlusion or {}
    before = [] if occlusion is False else [{"occlusion": settings}]
    if occlusion is False:
        keys = {"occlusion": "none", **keys}
    text = _stages(mesh, *before, {"render": keys}, {"write": {"vti": "picture.vti", "arrays": list(arrays)}})
    values = (occlusion.values, occlusion.errors) if isinstance(occlusion, Occlusion) else None
    with _watching(progress) as watch:
        picture = _picture(_native.render(mesh._native, text, values, threads, watch))
    for note in picture.notes:
        _warnings.warn(note, stacklevel=2)
    return picture


def _picture(found: tuple) -> Picture:
    dimensions, origin, spacing, arrays, accuracy, notes = found
    return Picture(tuple(dimensions), tuple(origin), tuple(spacing), dict(arrays), accuracy, list(notes))


def read_image(path: PathLike) -> Picture:
    """An image from a file: `.vti`, `.pvti`, or `.vtk` with structured points."""
    return _picture(_native.read_image(_os.fspath(path)))


def run(
    pipeline: Pipeline,
    out: Optional[PathLike] = None,
    set: Optional[Mapping[str, Any]] = None,
    *,
    threads: Optional[int] = None,
    backend: str = "cpu",
    force: bool = False,
    progress: Progress = None,
) -> Report:
    """Runs a pipeline: the path of a file, or a text of more than one line, or a dictionary.

    Files go into `out`, or into out/NAME. `set` changes values for this run: {"occlusion.samples": 64}. A second run makes
    only what has changed.
    """
    text, path = _source(pipeline)
    out = None if out is None else _os.fspath(out)
    with _watching(progress) as watch:
        report = _json.loads(_native.run(text, path, _sets(set), out, threads, backend, force, watch))
    folder = Path(report["out"])
    files = [folder / file["path"] for file in report["files"]]
    cached = [folder / file["path"] for file in report["files"] if file["cached"]]
    stages = [(stage["stage"], stage["seconds"], stage["detail"]) for stage in report["stages"]]
    return Report(folder, files, cached, report["notes"], report["seconds"], stages)


def check(pipeline: Pipeline, set: Optional[Mapping[str, Any]] = None) -> dict:
    """What a pipeline would do: everything short of running it."""
    return _json.loads(_native.check(*_source(pipeline), _sets(set)))


def compare(
    a: Any,
    b: Any,
    *,
    atol: float = 0.0,
    rtol: float = 0.0,
    max_different: int = 0,
    arrays: Sequence[str] = (),
) -> Comparison:
    """How far two pictures, two occlusions, two arrays, or two files are apart.

    A value differs where |a - b| > atol + rtol |b|.
    """
    tolerances = (float(atol), float(rtol), int(max_different))
    if isinstance(a, (str, _os.PathLike)) and isinstance(b, (str, _os.PathLike)):
        text = _native.compare_files(_os.fspath(a), _os.fspath(b), tolerances, list(arrays))
    else:
        text = _native.compare_images(_image(a), _image(b), tolerances, list(arrays))
    found = _json.loads(text)
    return Comparison(found["same"], found["differences"], found["arrays"])


def _image(thing: Any) -> tuple:
    if isinstance(thing, (str, _os.PathLike)):
        thing = read_image(thing)
    if isinstance(thing, Picture):
        arrays = [(name, np.ascontiguousarray(array)) for name, array in thing.arrays.items()]
        return thing.dimensions, thing.origin, thing.spacing, arrays
    if isinstance(thing, Occlusion):
        thing = {"ambient_occlusion": thing.values}
    if not isinstance(thing, Mapping):
        thing = {"values": thing}
    arrays = [(name, np.ascontiguousarray(array)) for name, array in thing.items()]
    arrays = [(name, array if array.ndim < 3 else array.reshape(-1)) for name, array in arrays]
    count = max((len(array) for _, array in arrays), default=0)
    return (count, 1, 1), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), arrays


def info(path: PathLike) -> dict:
    """What a file holds."""
    return _json.loads(_native.info(_os.fspath(path)))


def schema() -> dict:
    """The JSON Schema of pipelines: every key, with what it means."""
    return _json.loads(_native.schema())
