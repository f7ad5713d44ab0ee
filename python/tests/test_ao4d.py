"""What the package claims. Run by pytest, or as a script, which needs numpy and PyVista only."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from pathlib import Path

import numpy as np

import ao4d

# A tetrahedron in 4D, and one behind it in w, a little aside.
FRONT = np.array([[-0.6, -0.6, -0.6, -0.2], [0.6, -0.6, -0.6, -0.2], [0, 0.6, -0.6, -0.2], [0, 0, 0.6, -0.2]])
BACK = FRONT + [0.3, 0.2, 0.1, -0.1]
CELL = np.array([[0, 1, 2, 3]])
EYE = [0, 0, 0, 1]

PIPELINE = """
name: small
stages:
  - scene: {objects: [{tesseract: {size: 1}}, {box: {min: [-1, -1, -1, -1], max: [1, 1, 1, -0.9]}}]}
  - occlusion: {samples: 16, file: ao.f32}
  - render: {dimensions: [8, 8, 8]}
  - write: {vti: small.vti}
"""


def two():
    front = ao4d.Object(FRONT, CELL, name="front", facing=EYE, color=(1, 0, 0))
    return ao4d.Mesh.of([front, ao4d.Object(BACK, CELL, facing=EYE)])


def refusal(kind, work):
    try:
        work()
    except kind as error:
        return str(error)
    raise AssertionError("it wasn't refused")


def test_a_mesh_keeps_its_arrays():
    mesh = two()
    assert mesh.dimension == 4 and mesh.names == ["front", "object 2"] and not mesh.closed
    assert mesh.vertices.dtype == np.float32 and np.array_equal(mesh.vertices, np.vstack([FRONT, BACK]).astype(np.float32))
    assert np.array_equal(np.sort(mesh.simplices, axis=1), [[0, 1, 2, 3], [4, 5, 6, 7]])
    assert np.array_equal(mesh.object, [1] * 4 + [2] * 4)
    assert np.allclose(np.abs(mesh.normals), [0, 0, 0, 1], atol=1e-6)
    assert mesh.vertices is mesh.vertices, "the same array, not a copy a time"
    assert repr(mesh) == "<ao4d.Mesh in 4D: 2 objects, 8 vertices, 2 simplices>"


def test_occlusion_of_known_scenes():
    # A convex body hides nothing of itself; the closed form and rays agree elsewhere.
    cube = ao4d.load_scene({"name": "c", "stages": [{"scene": {"objects": [{"tesseract": {}}]}}]})
    assert cube.closed and np.all(ao4d.occlusion(cube, samples=4).values == 1)
    exact = ao4d.occlusion(two(), method="exact")
    rays = ao4d.occlusion(two(), samples=4096)
    assert exact.rays == 0 and rays.rays == 8 * 4096 and exact.error == 0 < rays.error < 0.01
    assert exact.values.dtype == np.float32 and exact.values.min() < 0.5
    assert np.all(np.abs(exact.values - rays.values) < 0.02)
    # In 3D a floor near an endless wall has half of its sky: nearly so for a large one.
    floor = ao4d.Object([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    wall = ao4d.Object([[0, -1e4, 0], [0, 1e4, 0], [0, 0, 1e5]], [[0, 1, 2]])
    found = ao4d.occlusion(ao4d.Mesh.of([floor, wall]), method="exact")
    assert abs(found.values[1] - 0.5) < 0.01, found.values


def test_the_same_for_any_number_of_threads():
    one, many = (ao4d.occlusion(two(), samples=64, threads=n).values for n in (1, 3))
    assert np.array_equal(one, many)


def test_pictures():
    mesh = two()
    found = ao4d.occlusion(mesh, samples=64)
    picture = ao4d.render(mesh, found, dimensions=[12, 10, 8], arrays=["rgba", "ambient_occlusion", "opacity", "normal"])
    assert picture.dimensions == (12, 10, 8) and picture["rgba"].shape == (8, 10, 12, 4)
    assert picture["rgba"].dtype == np.uint8 and picture["opacity"].dtype == np.float32
    assert np.shares_memory(picture["rgba"], picture.arrays["rgba"]), "a view"
    assert 0 < picture["opacity"].mean() < 1 and picture["ambient_occlusion"].min() < 0.95
    assert picture.accuracy[0] < 0.05
    # The picture lies around the middle of the image, x fastest.
    assert np.allclose(np.array(picture.origin) + (np.array(picture.dimensions) - 1) / 2 * picture.spacing, 0, atol=1e-12)
    assert ao4d.compare(picture, ao4d.render(mesh, found, dimensions=(12, 10, 8), arrays=list(picture.arrays)))
    plain = ao4d.render(mesh, False, dimensions=[12, 10, 8])
    assert plain["ambient_occlusion"].min() == 1
    found_there = ao4d.render(mesh, {"samples": 64}, dimensions=[12, 10, 8])
    assert ao4d.compare({"a": found_there["rgba"]}, {"a": picture["rgba"]}), "the values that `occlusion` finds"
    away = ao4d.render(mesh, found, dimensions=np.array([4, 4, 4]), camera={"eye": np.array([0, 0, 0, 5.0])})
    assert not ao4d.compare(away, ao4d.render(mesh, found, dimensions=[4, 4, 4]))


def test_cameras_fit_meshes_in_memory():
    # In millimetres, far from where the default camera looks.
    for dimension, size in ((4, [24, 24, 24]), (3, [24, 24])):
        scene = {"dimension": dimension, "objects": [{"box": {"min": [40, 10, 0, 5][:dimension], "max": [120, 60, 30, 25][:dimension]}}]}
        mesh = ao4d.load_scene({"name": "box", "stages": [{"scene": scene}]})
        eye = ([0, 0, 0, 1] if dimension == 4 else [0, 0, 1])
        picture = ao4d.render(mesh, False, dimensions=size, camera={"eye": eye, "fit": True}, dilate=0, supersample=1)
        covered = picture["opacity"].reshape(-1, 24, 24) > 0
        wide = covered.any(axis=(0, 1))
        assert wide[2:22].all() and not wide[0] and not wide[-1], "its longest side all but fills the image"
        assert 0.2 < covered.any(axis=(0, 2)).mean() < 0.9


def test_pyvista_takes_pictures():
    picture = ao4d.render(two(), False, dimensions=[5, 6, 7], supersample=1)
    image = picture.to_pyvista()
    assert image.dimensions == (5, 6, 7) and image.n_points == 210
    assert np.allclose(image.origin, picture.origin) and np.allclose(image.spacing, picture.spacing)
    place = image.find_closest_point((0.3, -0.3, 0.0))
    x, y, z = (round((p - o) / s) for p, o, s in zip(image.points[place], picture.origin, picture.spacing))
    assert np.array_equal(image["rgba"][place], picture["rgba"][z, y, x])
    assert np.shares_memory(np.asarray(image.point_data["opacity"]), picture.arrays["opacity"]), "no copy"


def test_runs():
    with tempfile.TemporaryDirectory() as folder:
        report = ao4d.run(PIPELINE, out=folder, set={"occlusion.samples": 8})
        assert [file.name for file in report.files] == ["ao.f32", "small.vti"] and not report.cached
        assert all(file.is_file() for file in report.files)
        again = ao4d.run(PIPELINE, out=Path(folder), set={"occlusion.samples": 8})
        assert again.cached == again.files
        picture = report.picture()
        assert picture.dimensions == (8, 8, 8) and ao4d.compare(picture, report.files[1])
        mesh = ao4d.load_scene(PIPELINE)
        found = ao4d.occlusion(mesh, samples=8)
        assert np.array_equal(found.values, np.fromfile(report.files[0], dtype="<f4"))
        memory = ao4d.render(mesh, {"samples": 8}, dimensions=[8, 8, 8], arrays=["ambient_occlusion", "opacity"])
        for name in ("ambient_occlusion", "opacity"):
            assert np.array_equal(memory[name], picture[name]), name
        assert ao4d.info(report.files[1])
        file = Path(folder) / "p.yaml"
        file.write_text(PIPELINE)
        assert ao4d.check(file)["totals"]["voxels"] == 512
        assert ao4d.check(json.loads(json.dumps({"name": "d", "stages": [{"scene": {"objects": [{"tesseract": {}}]}}]})))["name"] == "d"
    assert "stages" in ao4d.schema()["properties"]


def test_comparisons():
    a = np.linspace(0, 1, 24, dtype=np.float32).reshape(2, 3, 4)
    b = a.copy()
    b[1, 2, 3] += 0.5
    assert ao4d.compare(a, a) and ao4d.compare(a, b, atol=0.6) and ao4d.compare(a, b, max_different=1)
    found = ao4d.compare(a, b)
    assert not found and found.arrays[0]["different"] == 1 and abs(found.arrays[0]["largest"] - 0.5) < 1e-6
    assert not ao4d.compare(a, b.astype(np.float64)[:1])


def test_refusals_name_what_is_wrong():
    mesh = two()
    for kind, work, words in [
        (ValueError, lambda: ao4d.occlusion(mesh, sampels=3), "sampels: unknown key, did you mean `samples`?"),
        (ao4d.PipelineError, lambda: ao4d.render(mesh, dimensions=[3, 3]), "expected [WIDTH, HEIGHT, DEPTH] for a 4D scene"),
        (ao4d.PipelineError, lambda: ao4d.render(mesh, dimensions=[3, 3, 3], arrays=["rgbb"]), "rgbb"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT, [[0, 1, 2, 4]]), "object 1: vertex 4 does not exist; there are 4"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT, [[0, 1, 2, -1]]), "vertex -1 does not exist"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT, [[0, 1, 2]]), "simplices have 3 columns; expected 4"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT, [[0, 1, 2.5, 3]]), "whole numbers"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT[:, :2], [[0, 1]]), "expected 3 or 4 coordinates each, found 2"),
        (ao4d.PipelineError, lambda: ao4d.Mesh([1, 2], [3]), "expected tables"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT * np.nan, CELL), "coordinate"),
        (ao4d.PipelineError, lambda: ao4d.Mesh(FRONT, CELL, facing=[0, 0, 1]), "facing: expected 4 coordinates"),
        (ao4d.PipelineError, lambda: ao4d.Mesh.of([]), "at least one object"),
        (ao4d.PipelineError, lambda: ao4d.run("no/such.yaml"), "no/such.yaml"),
        (ao4d.PipelineError, lambda: ao4d.run(PIPELINE, set={"occlusion.sampels": 3}), "sampels"),
        (ao4d.PipelineError, lambda: ao4d.read_image("nothing.vti"), "nothing.vti"),
        (ValueError, lambda: ao4d.occlusion(mesh, threads=0), "threads: expected a whole number"),
        (ValueError, lambda: ao4d.compare(FRONT, FRONT, atol=-1), "atol"),
        (TypeError, lambda: ao4d.compare(np.array(["a"]), FRONT), "expected an array of numbers"),
        (KeyError, lambda: ao4d.render(mesh, False, dimensions=[2, 2, 2])["depth"], "depth; there are rgba"),
        (ao4d.PipelineError, lambda: ao4d.render(mesh, ao4d.Occlusion(np.ones(3, "f4"), np.ones(3, "f4")), dimensions=[2, 2, 2]), "one value for each"),
    ]:
        told = refusal(kind, work)
        assert words.lower() in told.lower(), f"{told!r} lacks {words!r}"


def test_light_passes_objects():
    objects = [ao4d.Object(FRONT, CELL, facing=EYE, opacity=0.5), ao4d.Object(BACK, CELL, facing=EYE)]
    mesh = ao4d.Mesh.of(objects)
    opaque = ao4d.occlusion(two(), samples=256).values
    values = ao4d.occlusion(mesh, samples=256).values
    assert np.all(values >= opaque - 1e-6) and values.sum() > opaque.sum()
    assert "knows opaque objects only" in refusal(ValueError, lambda: ao4d.occlusion(mesh, method="exact"))
    picture = ao4d.render(mesh, {"samples": 64}, dimensions=[9, 9, 9])
    assert picture["opacity"].max() > 0


def test_warnings_are_pythons():
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        ao4d.render(two(), {"samples": 4, "max_samples": 9}, dimensions=[2, 2, 2], camera={"eye": [0, 0, 0, -9], "target": [0, 0, 0, -10]})
    texts = " ".join(str(one.message) for one in told)
    assert "max_samples: has no effect" in texts and "background only" in texts, texts


def test_progress_is_told():
    told = []
    ao4d.occlusion(heavy(), samples=512, progress=lambda *step: told.append(step))
    stages = {stage for stage, _, _ in told}
    assert "occlusion" in stages, told[:3]
    done = [done / total for stage, done, total in told if stage == "occlusion" and total]
    assert done == sorted(done) and done[-1] <= 1

    def stop(*step):
        raise RuntimeError("enough")

    began = time.monotonic()
    assert refusal(RuntimeError, lambda: ao4d.occlusion(heavy(), samples=60_000, progress=stop)) == "enough"
    assert time.monotonic() - began < 5


def heavy():
    return ao4d.load_scene({"name": "h", "stages": [{"scene": {"objects": [{"tesseract": {"subdivisions": 6}}, {"box": {"min": [-2, -2, -2, -2], "max": [2, 2, 2, -1.5], "subdivisions": 4}}]}}]})


def test_other_threads_run():
    mesh, ticks, stop = heavy(), [], threading.Event()

    def tick():
        while not stop.wait(0.01):
            ticks.append(time.monotonic())

    ticker = threading.Thread(target=tick)
    ticker.start()
    began = time.monotonic()
    ao4d.occlusion(mesh, samples=768)
    took = time.monotonic() - began
    stop.set()
    ticker.join()
    assert len(ticks) > 5 and max(np.diff(ticks)) < max(0.5, took / 2), (len(ticks), took)


def test_ctrl_c_interrupts():
    script = (
        "import sys, time, ao4d; sys.path.insert(0, sys.argv[1]); from test_ao4d import heavy\n"
        "mesh = heavy(); print('ready', flush=True)\n"
        "try: ao4d.occlusion(mesh, samples=1_000_000)\n"
        "except KeyboardInterrupt: print('interrupted', flush=True)\n"
        "print(ao4d.occlusion(mesh, samples=1).rays > 0)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", script, str(Path(__file__).parent)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    began = time.monotonic()
    assert child.stdout.readline() == "interrupted\n"
    # A second, and what a busy machine takes.
    assert time.monotonic() - began < 3, time.monotonic() - began
    assert child.stdout.readline() == "True\n", "Python goes on"
    assert child.wait(30) == 0


def test_the_command_line_comes_along():
    def ao4d_program(*arguments):
        return subprocess.run([sys.executable, "-m", "ao4d", *arguments], capture_output=True, text=True)

    version = ao4d_program("--version")
    assert version.returncode == 0 and version.stdout.startswith(f"ao4d {ao4d.__version__}")
    refused = ao4d_program("run", "nothing.yaml")
    assert refused.returncode == 2 and "nothing.yaml" in refused.stderr
    assert json.loads(ao4d_program("schema").stdout) == ao4d.schema()


def test_what_is_typed_is_there():
    folder = Path(ao4d.__file__).parent
    assert (folder / "py.typed").is_file()
    stub = (folder / "_native.pyi").read_text()
    for name in dir(ao4d._native):
        if not name.startswith("__"):
            assert f"def {name}(" in stub or f"class {name}" in stub, f"{name} has no type"
    assert all(hasattr(ao4d, name) for name in ao4d.__all__)


def test_the_reference_has_every_key():
    docs = Path(__file__).parents[2] / "docs"
    names = {}
    exec((docs / "reference.py").read_text(), names)
    page = (docs / "reference.md").read_text()
    assert page == names["page"](ao4d.schema()), "run: ao4d schema | python3 docs/reference.py > docs/reference.md"
    assert page.count("## ") > 40 and "Spec" not in "".join(line for line in page.splitlines() if line.startswith("## "))


if __name__ == "__main__":
    for name, test in list(globals().items()):
        if name.startswith("test_"):
            began = time.monotonic()
            test()
            print(f"{name}: {time.monotonic() - began:.2f} s")
