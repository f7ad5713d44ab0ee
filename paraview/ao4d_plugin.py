"""ParaView plugin: ambient occlusion in four dimensions, by the program `ao4d`.

Tools > Manage Plugins > Load New > this file (tick Auto Load to keep it). It needs ParaView 5.10 or later and the program, which it
looks for in the property Program, in the environment variable AO4D, in PATH, and where cargo and pip put it. Then

- File > Open a pipeline (.yaml): its picture, with the properties that one turns: method, samples, voxels, tolerance, the 4D camera;
- Sources > ao4d Slice: the exact cross-section of a pipeline's scene at some w;
- Sources > ao4d Film: a pipeline's `animate` stage, or a turn of its camera, frame by frame for ParaView's Play button;
- Filters > ao4d Occlusion: ambient occlusion on what is in ParaView already. Of a grid of tetrahedra with four coordinates (a point
  array of four components, or a fourth coordinate beside the points) in 4D; of a series of images over time on the isosurface in
  space and time; of anything else in 3D on its outer surface.

In scripts: `LoadPlugin(".../ao4d_plugin.py", ns=globals())`, `p = ao4dPicture(FileName="...yaml")`, `Show(p)`.

ParaView before 5.12 with Python 3.11 or later, such as Debian 12's, can't load plugins by itself. There run this file as a script, which
mends that and loads it: Python Shell > Run Script, or `paraview --script=.../ao4d_plugin.py`.
"""

import hashlib
import inspect
import json
import math
import os
import re
import shutil
import signal
import subprocess
import tempfile
import threading

if not hasattr(inspect, "getargspec"):  # what ParaView before 5.12 asks for, and Python since 3.11 lacks
    inspect.getargspec = inspect.getfullargspec

from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkDataSet, vtkImageData, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as keys

METHODS = ["(as in the file)", "sobol", "random", "adaptive", "exact", "as_published"]
PLANES = ["(as in the file)", "xw", "yw", "zw", "xy", "xz", "yz"]


class Refused(Exception):
    """What the user is told, without a traceback."""


class Cancelled(Exception):
    """The user pressed Cancel."""


# ---------------------------------------------------------------------------------------------------------------- the program


def find_program(named):
    """The program: as named, by AO4D, in PATH, or where cargo and pip put it."""
    home = os.path.expanduser("~")
    places = [named, os.environ.get("AO4D"), "ao4d"]
    places += [os.path.join(home, folder, "ao4d") for folder in (".cargo/bin", ".local/bin")]
    for place in places:
        found = place and shutil.which(os.path.expanduser(place))
        if found:
            return found
        if place and place == named:
            raise Refused("ao4d: there is no program %s; see the property Program" % named)
    raise Refused(
        "ao4d: the program is not found. Install it (cargo install ao4d, or pip install ao4d), or name it in the property "
        "Program or in the environment variable AO4D."
    )


def environment():
    """The environment of the program: ParaView's own libraries and Python are not its business."""
    hidden = ("LD_LIBRARY_PATH", "PYTHONHOME", "PYTHONPATH")
    return {key: value for key, value in os.environ.items() if key not in hidden}


def call(program, arguments, on_event=None, cancelled=lambda: False):
    """Runs the program; returns what it prints, as JSON. What it tells meanwhile goes to `on_event`, and None every tenth of a second."""
    arguments = arguments + ["--progress", "json"]
    quiet = {"creationflags": getattr(subprocess, "CREATE_NO_WINDOW", 0)}
    child = subprocess.Popen(
        [program] + arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(), universal_newlines=True, **quiet
    )
    lines, printed, events = [], [], []
    readers = [
        threading.Thread(target=_read, args=(child.stderr, lines)),
        threading.Thread(target=_read, args=(child.stdout, printed)),
    ]
    for reader in readers:
        reader.start()
    seen, stopped = 0, False
    while True:
        try:
            child.wait(0.1)
        except subprocess.TimeoutExpired:
            pass
        if child.returncode is not None:
            for reader in readers:
                reader.join()
        while seen < len(lines):
            events.append(event_of(lines[seen]))
            if on_event:
                on_event(events[-1])
            seen += 1
        if child.returncode is not None:
            break
        if on_event:
            on_event(None)
        if not stopped and cancelled():
            stopped = True
            child.send_signal(signal.SIGINT) if os.name != "nt" else child.terminate()
    if stopped:
        raise Cancelled()
    if child.returncode:
        errors = [event["message"] for event in events if event["event"] == "error"]
        raise Refused("ao4d: " + ("\n".join(errors) or "the program ended with %s" % child.returncode))
    return json.loads("".join(printed))


def event_of(line):
    """What a line of the program's messages tells. What is wrong with its arguments is told as text, in a few lines."""
    try:
        return json.loads(line)
    except ValueError:
        return {"event": "error", "message": re.sub(r"^error: ", "", line.rstrip())}


def _read(stream, lines):
    for line in stream:
        lines.append(line)
    stream.close()


def tell(message, is_error=False):
    """Says something in Output Messages."""
    window = vtkOutputWindow.GetInstance()
    (window.DisplayErrorText if is_error else window.DisplayText)(message.rstrip() + "\n")


# ------------------------------------------------------------------------------------------------------------ the 4D camera


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(v):
    length = math.sqrt(dot(v, v))
    return [x / length for x in v]


def across(v, frame):
    """The unit part of a vector that is orthogonal to a frame."""
    for base in frame:
        along = dot(v, base)
        v = [x - along * b for x, b in zip(v, base)]
    return unit(v)


def right_of(frame):
    """The direction that makes (right, up, over, back), or (right, up, back) in 3D, as right-handed as the axes are."""
    count = len(frame[0])
    axes = [[float(i == a) for i in range(count)] for a in range(count)]
    right = max((across(axis, frame) for axis in axes if _far(axis, frame)), key=lambda v: max(map(abs, v)))
    return right if determinant([right] + frame) > 0 else [-x for x in right]


def _far(axis, frame):
    return dot(axis, axis) - sum(dot(axis, base) ** 2 for base in frame) > 1e-3


def determinant(rows):
    if len(rows) == 1:
        return rows[0][0]
    minors = ([row[:i] + row[i + 1 :] for row in rows[1:]] for i in range(len(rows)))
    return sum((-1) ** i * rows[0][i] * determinant(minor) for i, minor in enumerate(minors))


def turned(camera, angles, distance):
    """A plan's camera, as it is written, with its eye turned about its target by these degrees and moved this many times as far.

    The planes xw, yw and zw are those of the camera's own right, up and over with its line of sight, turned one after the other, as
    `animate: {turn: {plane: xw}}` turns the eye of a camera that stands on the w axis. In 3D the line of sight takes the place of w,
    and there is no third plane.
    """
    eye, target, up, over = camera["eye"], camera["target"], camera["up"], camera.get("over")
    line = [e - t for e, t in zip(eye, target)]
    frame = [unit(line)]
    if over:
        frame.insert(0, across(over, frame))
    frame.insert(0, across(up, frame))
    frame.insert(0, right_of(frame))
    # In the camera's own coordinates: which axis goes towards which by each angle.
    last = len(frame) - 1

    def turn(vector):
        own = [dot(vector, base) for base in frame]
        for axis, degrees in zip(range(last), angles):
            c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            own[axis], own[last] = c * own[axis] - s * own[last], s * own[axis] + c * own[last]
        return [sum(x * base[i] for x, base in zip(own, frame)) for i in range(len(vector))]

    (projection, settings), = camera["projection"].items()
    written = {"projection": projection, "target": target}
    written.update(settings)
    written["eye"] = [t + distance * x for t, x in zip(target, turn(line))]
    written["up"] = turn(up)
    if over:
        written["over"] = turn(over)
    return written


# ----------------------------------------------------------------------------------------------------------------- the plan


class Plan:
    """What the program understands of a pipeline, and the changes that make one picture of it."""

    def __init__(self, plan, sets):
        self.plan, self.sets = plan, list(sets)

    def kinds(self):
        """The kinds of stages that there are, each once."""
        return list(dict.fromkeys(next(iter(stage)) for stage in self.plan["order"]))

    def keep(self, *kept):
        """Takes out the stages of all other kinds."""
        self.sets += ["%s=" % kind for kind in self.kinds() if kind not in kept]

    def render(self, named):
        """The render of this id, or the last one."""
        renders = self.plan["renders"]
        if not renders:
            raise Refused("ao4d: the pipeline has no `render`, so there is no picture of it")
        if not named:
            return renders[-1]
        for render in renders:
            if render["id"] == named:
                return render
        known = ", ".join(render["id"] for render in renders)
        raise Refused("ao4d: no render is called %s; there are %s" % (named, known))

    def name(self, stage, kind, many):
        """How --set names a stage: by its id where it has one of its own, by its kind where it is the only one."""
        made_up = re.fullmatch(r"%s(-\d+)?" % kind, stage["id"])
        if made_up and len(self.plan[many]) > 1:
            tell("ao4d: several `%s` stages; give each an `id`, so that they can be changed one by one" % kind)
        return kind if made_up else stage["id"]

    def change(self, stage, **changes):
        for key, value in changes.items():
            self.sets.append("%s.%s=%s" % (stage, key, "" if value is None else json.dumps(value)))

    def occlusion(self, index, method, samples):
        """Keeps the values of an occlusion in a file, so that they are computed once, whatever the camera; and of no other."""
        occlusions = self.plan["occlusions"]
        if not occlusions:
            return
        computed = [o for o in occlusions if "compute" in o["source"]]
        for other in computed:
            self.change(self.name(other, "occlusion", "occlusions"), file=None)
        if index is None:
            return
        own = occlusions[index]
        name = self.name(own, "occlusion", "occlusions")
        if method:
            self.change(name, load=None, method=METHODS[method])
            if METHODS[method] in ("exact", "as_published"):
                self.change(name, target_error=None, max_samples=None)
            if METHODS[method] == "exact":
                self.change(name, samples=None)
        if samples > 0 and METHODS[method] != "exact":
            self.change(name, load=None, target_error=None, max_samples=None, samples=samples)
        if own in computed or method or samples > 0:
            self.change(name, file="values.f32")


def scaled(dimensions, voxels, flat):
    """Dimensions of the same shape whose largest is `voxels`."""
    scale = voxels / max(dimensions)
    return [max(1, round(n * scale)) for n in (dimensions[:2] if flat else dimensions)]


# ------------------------------------------------------------------------------------------------------------ what they share


class Base(VTKPythonAlgorithmBase):
    """What all have: the program, a folder of their own, and results that stay until something changes."""

    def setup(self):
        self._values = {}
        self._folder = tempfile.mkdtemp(prefix="ao4d-")
        self._plans, self._made, self._what, self._said = {}, None, None, None

    def __del__(self):
        shutil.rmtree(getattr(self, "_folder", ""), ignore_errors=True)

    def put(self, name, value):
        value = "" if value in (None, "None") else value
        if self._values.get(name) != value:
            self._values[name] = value
            self._said = None
            self.Modified()

    def get(self, name, default=None):
        return self._values.get(name, default)

    def stopped(self):
        """Whether Cancel was pressed."""
        abort = getattr(self, "GetAbortExecute", None)
        return bool(abort and abort())

    def guarded(self, work):
        """Does the work; tells what is wrong, once, as ParaView tells errors. There is no output then, and no traceback."""
        try:
            work()
            return 1
        except Cancelled:
            message, is_error = "ao4d: cancelled; change something, and Apply, to go on", False
        except Refused as refusal:
            message, is_error = str(refusal), True
        except OSError as error:
            message, is_error = "ao4d: %s" % error, True
        if message != self._said:
            self._said = message
            tell(message, is_error)
        return 1

    def file(self):
        file = self.get("FileName")
        if not file:
            raise Refused("ao4d: choose a pipeline: the property File Name")
        if not os.path.isfile(file):
            raise Refused("ao4d: %s: there is no such file" % file)
        return file

    def user_sets(self):
        return [one.strip() for one in re.split(r"[;\n]", self.get("Set", "")) if one.strip()]

    def plan(self):
        """What `check` says of the pipeline, asked again when the file changes."""
        file, sets = self.file(), self.user_sets()
        stat = os.stat(file)
        key = (file, stat.st_mtime_ns, stat.st_size, tuple(sets), self.get("Program"))
        if key not in self._plans:
            arguments = ["check", "--json", "-q", file] + [part for one in sets for part in ("--set", one)]
            self._plans = {key: call(find_program(self.get("Program")), arguments, cancelled=self.stopped)}
        return Plan(self._plans[key], sets)

    def run(self, file, sets, folder=None):
        """Runs a pipeline with these changes; its report. Nothing if all is as it was."""
        stat = os.stat(file)
        key = (file, stat.st_mtime_ns, stat.st_size, tuple(sets), self.get("Program"))
        if self._what == key and self._made is not None:
            return self._made
        self._made = None
        program = find_program(self.get("Program"))
        shown = {"before": 0.0, "now": 0.0}

        def on_event(event):
            # How many stages will do something is not known before: each takes some of the bar that is left.
            kind, left = event and event["event"], 0.4 * (1.0 - shown["before"])
            if kind == "advance" and event["total"]:
                shown["now"] = shown["before"] + left * min(1.0, event["done"] / event["total"])
            elif kind == "end":
                shown["now"] = shown["before"] = shown["before"] + left
            elif kind in ("note", "warning") and "no `write` stage writes" not in event["message"]:
                tell("ao4d: %s: %s" % (kind, event["message"]))
            # Also when nothing is told: by this ParaView learns of Cancel.
            self.UpdateProgress(shown["now"])

        arguments = ["run", "--json", "--out", folder or self._folder, file]
        arguments += [part for one in sets for part in ("--set", one)]
        report = call(program, arguments, on_event, self.stopped)
        self._what, self._made = key, report
        return report

    def read(self, name, reader):
        """A file of the last run."""
        r = reader()
        r.SetFileName(os.path.join(self._folder, name))
        r.Update()
        return r.GetOutput()


def image_reader():
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    return vtkXMLImageDataReader()


def poly_reader():
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    return vtkXMLPolyDataReader()


def grid_reader():
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    return vtkXMLUnstructuredGridReader()


# ----------------------------------------------------------------------------------------- properties, as ParaView describes them


def text(name, label, help, default="", level="default", more=""):
    return (
        '<StringVectorProperty name="%s" label="%s" command="Set%s" number_of_elements="1" default_values="%s" panel_visibility="%s">'
        "%s<Documentation>%s</Documentation></StringVectorProperty>" % (name, label, name, default, level, more, help)
    )


def number(name, label, help, default, low, high, kind="Double", level="default"):
    return (
        '<%sVectorProperty name="%s" label="%s" command="Set%s" number_of_elements="1" default_values="%s" panel_visibility="%s">'
        '<%sRangeDomain name="range" min="%s" max="%s"/><Documentation>%s</Documentation></%sVectorProperty>'
        % (kind, name, label, name, default, level, kind, low, high, help, kind)
    )


def choice(name, label, help, words, level="default"):
    entries = "".join('<Entry value="%d" text="%s"/>' % pair for pair in enumerate(words))
    return (
        '<IntVectorProperty name="%s" label="%s" command="Set%s" number_of_elements="1" default_values="0" panel_visibility="%s">'
        '<EnumerationDomain name="enum">%s</EnumerationDomain><Documentation>%s</Documentation></IntVectorProperty>'
        % (name, label, name, level, entries, help)
    )


FILE = text(
    "FileName", "File Name", "The pipeline.", more='<FileListDomain name="files"/><Hints><FileChooser extensions="yaml yml" '
    'file_description="ao4d pipelines"/></Hints>'
)
METHOD = choice("Method", "Method", "How ambient occlusion is computed.", METHODS)
SAMPLES = number("Samples", "Samples", "Rays a vertex; 0: as in the file.", 0, 0, 4096, "Int")
SET = text(
    "Set", "Set", "Any other change: KEY=VALUE as --set takes it, several separated by semicolons; render.shading=voxel, say."
)
PROGRAM = text("Program", "Program", "Where the program ao4d is; empty: AO4D, PATH, and the usual places.", level="advanced")
TIMES = '<DoubleVectorProperty name="TimestepValues" information_only="1" si_class="vtkSITimeStepsProperty" repeatable="1"/>'
VOLUME = '<RepresentationType view="RenderView" type="Volume"/>'
PICTURE = text("Picture", "Picture", "The id of a render stage; empty: the last one.")
VOXELS = number("Voxels", "Voxels", "Along the longest axis; 0: as in the file.", 0, 0, 256, "Int")
TOLERANCE = number("Tolerance", "Tolerance", "The error that a voxel may have; 0: as in the file.", 0, 0, 0.1)
SUPERSAMPLE = number("Supersample", "Supersample", "Samples a voxel along each axis; 0: as in the file.", 0, 0, 5, "Int")
CAMERA = (
    number("TurnXW", "Turn XW", "Degrees by which the eye turns about its target from right towards the line of sight.", 0, -180, 180)
    + number("TurnYW", "Turn YW", "The same from up.", 0, -180, 180)
    + number("TurnZW", "Turn ZW", "The same from over; of no use in 3D.", 0, -180, 180)
    + number("Distance", "Distance", "How many times as far as in the file the eye is from its target.", 1, 0.1, 10)
)


def setters(*names):
    """Gives a class the methods that its properties call."""

    def decorate(cls):
        for name in names:
            setattr(cls, "Set" + name, lambda self, value, name=name: self.put(name, value))
        return cls

    return decorate


# ---------------------------------------------------------------------------------------------------------------- the sources


@smproxy.reader(
    name="ao4dPicture", label="ao4d Picture", extensions="yaml yml", file_description="ao4d pipelines", support_reload=False
)
@smproperty.xml(FILE + PICTURE + METHOD + SAMPLES + VOXELS + TOLERANCE + SUPERSAMPLE + CAMERA + SET + PROGRAM)
@smhint.xml(VOLUME)
@setters(
    "FileName", "Picture", "Method", "Samples", "Voxels", "Tolerance", "Supersample", "TurnXW", "TurnYW", "TurnZW", "Distance", "Set",
    "Program",
)
class Ao4dPicture(Base):
    """The picture of a pipeline."""

    def __init__(self):
        VTKPythonAlgorithmBase.__init__(self, nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.setup()

    def render(self, plan):
        """The render, and its dimensions."""
        render = plan.render(self.get("Picture"))
        flat = plan.plan["scenes"][render["scene"]]["dimension"] == 3
        if self.get("Voxels", 0) > 0:
            return render, scaled(render["dimensions"], self.get("Voxels"), flat), flat
        return render, render["dimensions"][: 2 if flat else 3], flat

    def changes(self):
        plan = self.plan()
        render, dimensions, _ = self.render(plan)
        arrays = next((w["arrays"] for w in plan.plan["writes"] if plan.plan["renders"][w["render"]] is render), None)
        arrays = list(dict.fromkeys(["rgba", "ambient_occlusion", "opacity"] + (arrays or [])))
        plan.keep("scene", "occlusion", "render")
        plan.occlusion(render["occlusion"], self.get("Method", 0), self.get("Samples", 0))
        name = plan.name(render, "render", "renders")
        if self.get("Voxels", 0) > 0:
            plan.change(name, dimensions=dimensions)
        if self.get("Tolerance", 0) > 0:
            plan.change(name, tolerance=self.get("Tolerance"))
        if self.get("Supersample", 0) > 0:
            plan.change(name, supersample=self.get("Supersample"))
        angles = [self.get(turn, 0.0) for turn in ("TurnXW", "TurnYW", "TurnZW")]
        if any(angles) or self.get("Distance", 1.0) != 1.0:
            plan.change(name, camera=turned(render["camera"], angles, self.get("Distance", 1.0)))
        write = {"vti": "picture.vti", "arrays": arrays}
        if name != "render":
            write["input"] = name
        plan.sets.append("stages[+]=" + json.dumps({"write": write}))
        return plan.sets

    def RequestInformation(self, request, inputs, outputs):
        def work():
            _, dimensions, _ = self.render(self.plan())
            extent = [bound for n in (dimensions + [1])[:3] for bound in (0, n - 1)]
            outputs.GetInformationObject(0).Set(keys.WHOLE_EXTENT(), extent, 6)

        return self.guarded(work)

    def RequestData(self, request, inputs, outputs):
        def work():
            self.run(self.file(), self.changes())
            image = self.read("picture.vti", image_reader)
            image.GetPointData().SetActiveScalars("rgba")
            vtkImageData.GetData(outputs, 0).ShallowCopy(image)

        return self.guarded(work)


@smproxy.source(name="ao4dSlice", label="ao4d Slice", support_reload=False)
@smproperty.xml(
    FILE
    + number("W", "W", "Where the slice is along the scene's last axis.", 0, -2, 2)
    + METHOD
    + SAMPLES
    + SET
    + PROGRAM
)
@setters("FileName", "W", "Method", "Samples", "Set", "Program")
class Ao4dSlice(Base):
    """The exact cross-section of a pipeline's last scene at some w."""

    def __init__(self):
        VTKPythonAlgorithmBase.__init__(self, nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")
        self.setup()

    def RequestData(self, request, inputs, outputs):
        def work():
            plan = self.plan()
            own = [i for i, o in enumerate(plan.plan["occlusions"]) if o["scene"] == len(plan.plan["scenes"]) - 1]
            plan.keep("scene", "occlusion")
            plan.occlusion(own[-1] if own else None, self.get("Method", 0), self.get("Samples", 0))
            plan.sets.append("stages[+]=" + json.dumps({"slice": {"at": self.get("W", 0.0), "vtp": "slice.vtp"}}))
            self.run(self.file(), plan.sets)
            slice = self.read("slice.vtp", poly_reader)
            slice.GetPointData().SetActiveScalars("ambient_occlusion")
            vtkPolyData.GetData(outputs, 0).ShallowCopy(slice)

        return self.guarded(work)


@smproxy.source(name="ao4dFilm", label="ao4d Film", support_reload=False)
@smproperty.xml(
    TIMES
    + FILE
    + PICTURE
    + choice("Plane", "Plane", "The plane in which the eye turns; (as in the file): its last `animate` stage, or xw.", PLANES)
    + number("Frames", "Frames", "How many; 0: as in the file, or 24.", 0, 0, 360, "Int")
    + METHOD
    + SAMPLES
    + VOXELS
    + SET
    + PROGRAM
)
@smhint.xml(VOLUME)
@setters("FileName", "Picture", "Plane", "Frames", "Method", "Samples", "Voxels", "Set", "Program")
class Ao4dFilm(Base):
    """The frames of an animation, each at its time."""

    def __init__(self):
        VTKPythonAlgorithmBase.__init__(self, nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.setup()

    def film(self, plan):
        """The render, its dimensions, the frames, their rate, and what is to be added to the pipeline, if anything."""
        known = plan.plan["animations"]
        own = known[-1] if known and not self.get("Plane") and not self.get("Picture") else None
        render = plan.plan["renders"][own["render"]] if own else plan.render(self.get("Picture"))
        flat = plan.plan["scenes"][render["scene"]]["dimension"] == 3
        dimensions = render["dimensions"][: 2 if flat else 3]
        if self.get("Voxels", 0) > 0:
            dimensions = scaled(render["dimensions"], self.get("Voxels"), flat)
        frames = self.get("Frames", 0) or (len(own["files"]) if own else 24)
        return own, render, dimensions, frames, (own["rate"] if own else 24.0), flat

    def RequestInformation(self, request, inputs, outputs):
        def work():
            _, _, dimensions, frames, rate, _ = self.film(self.plan())
            extent = [bound for n in (dimensions + [1])[:3] for bound in (0, n - 1)]
            times = [frame / rate for frame in range(frames)]
            information = outputs.GetInformationObject(0)
            information.Set(keys.WHOLE_EXTENT(), extent, 6)
            information.Set(keys.TIME_STEPS(), times, len(times))
            information.Set(keys.TIME_RANGE(), [times[0], times[-1]], 2)

        return self.guarded(work)

    def RequestData(self, request, inputs, outputs):
        def work():
            plan = self.plan()
            own, render, dimensions, frames, rate, flat = self.film(plan)
            plan.keep("scene", "occlusion", "render", *(["animate"] if own else []))
            plan.occlusion(render["occlusion"], self.get("Method", 0), self.get("Samples", 0))
            name = plan.name(render, "render", "renders")
            if self.get("Voxels", 0) > 0:
                plan.change(name, dimensions=dimensions)
            if own:
                stage = plan.name(own, "animate", "animations")
                plan.change(stage, frames=frames, vti="film.vti")
            else:
                plane = PLANES[self.get("Plane", 0) or 1]
                film = {"frames": frames, "turn": {"plane": plane.replace("w", "z") if flat else plane}, "vti": "film.vti"}
                if name != "render":
                    film["input"] = name
                plan.sets.append("stages[+]=" + json.dumps({"animate": film}))
            report = self.run(self.file(), plan.sets)
            files = [f["path"] for f in report["files"] if f["path"].endswith(".vti")]
            information = outputs.GetInformationObject(0)
            time = information.Get(keys.UPDATE_TIME_STEP()) if information.Has(keys.UPDATE_TIME_STEP()) else 0.0
            frame = min(range(len(files)), key=lambda i: abs(i / rate - time))
            image = self.read(sorted(files)[frame], image_reader)
            image.GetPointData().SetActiveScalars("rgba")
            output = vtkImageData.GetData(outputs, 0)
            output.ShallowCopy(image)
            output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), frame / rate)

        return self.guarded(work)


# ----------------------------------------------------------------------------------------------------------------- the filter


@smproxy.filter(name="ao4dOcclusion", label="ao4d Occlusion", support_reload=False)
@smproperty.xml(
    choice("Method", "Method", "How ambient occlusion is computed.", ["sobol"] + METHODS[2:])
    + number("Samples", "Samples", "Rays a vertex.", 256, 1, 4096, "Int")
    + number("CreaseAngle", "Crease Angle", "Where neighbours' normals differ by more degrees, a point has a value for each side.", 30, 0, 180)
    + text(
        "FourthCoordinate", "Fourth Coordinate", "The point array with all four coordinates, or with the fourth alone; empty: "
        "`position`, if there is one of four components."
    )
    + text("Image", "Image Array", "Of images: the point array whose isosurface it is; empty: the active one.")
    + number("Isovalue", "Isovalue", "Of images: the value that the surface is at.", 0.5, 0, 1)
    + number("TimeScale", "Time Scale", "Of images over time: the length that a unit of time is drawn as.", 1, 0, 10)
    + PROGRAM
)
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkDataSet"], composite_data_supported=False)
@setters("Method", "Samples", "CreaseAngle", "FourthCoordinate", "Image", "Isovalue", "TimeScale", "Program")
class Ao4dOcclusion(Base):
    """Ambient occlusion at the points of what is in ParaView already."""

    def __init__(self):
        VTKPythonAlgorithmBase.__init__(
            self, nInputPorts=1, nOutputPorts=1, inputType="vtkDataSet", outputType="vtkUnstructuredGrid"
        )
        self.setup()
        self._times, self._steps = [], []

    def RequestInformation(self, request, inputs, outputs):
        information = inputs[0].GetInformationObject(0)
        times = information.Get(keys.TIME_STEPS()) if information.Has(keys.TIME_STEPS()) else ()
        self._times = list(times or ())
        return 1

    def over_time(self, inputs):
        """Whether all steps of time together are one body: those of images."""
        return len(self._times) > 1 and vtkDataSet.GetData(inputs[0], 0).IsA("vtkImageData")

    def RequestUpdateExtent(self, request, inputs, outputs):
        data = vtkDataSet.GetData(inputs[0], 0)
        if len(self._times) > 1 and data is not None and data.IsA("vtkImageData"):
            inputs[0].GetInformationObject(0).Set(keys.UPDATE_TIME_STEP(), self._times[len(self._steps)])
        return 1

    def RequestData(self, request, inputs, outputs):
        def work():
            data = vtkDataSet.GetData(inputs[0], 0)
            if self.over_time(inputs):
                step = vtkImageData()
                step.DeepCopy(data)
                self._steps.append(step)
                if len(self._steps) < len(self._times):
                    request.Set(keys.CONTINUE_EXECUTING(), 1)
                    return
                request.Remove(keys.CONTINUE_EXECUTING())
                scene = self.images(self._steps, self._times)
                self._steps, source = [], None
            elif data.IsA("vtkImageData"):
                scene, source = self.images([data], [0.0]), None
            else:
                scene, source = self.mesh(data)
            occlusion = {"method": (["sobol"] + METHODS[2:])[self.get("Method", 0)]}
            if occlusion["method"] != "exact":
                occlusion["samples"] = self.get("Samples", 256)
            stages = [{"scene": scene}, {"occlusion": occlusion}, {"mesh": {"vtu": "mesh.vtu"}}]
            pipeline = os.path.join(self._folder, "pipeline.yaml")
            write_if_new(pipeline, json.dumps({"name": "filter", "stages": stages}).encode())
            self.run(pipeline, [])
            mesh = self.read("mesh.vtu", grid_reader)
            if source is not None:
                hand_on(source, mesh)
            mesh.GetPointData().SetActiveScalars("ambient_occlusion")
            vtkUnstructuredGrid.GetData(outputs, 0).ShallowCopy(mesh)

        steps = len(self._steps)
        self.guarded(work)
        if len(self._steps) <= steps:  # all are there, or something is wrong
            self._steps = []
            request.Remove(keys.CONTINUE_EXECUTING())
        return 1

    def object(self, shape):
        angle = self.get("CreaseAngle", 30.0)
        return dict(shape, crease_angle=angle if angle < 180 else "off")

    def mesh(self, data):
        """The scene of a grid or a surface, and what its arrays are taken from."""
        four = self.four_coordinates(data)
        if four is not None:
            source = tetrahedra(data, four)
            name, dimension = "input.vtu", 4
        else:
            source = surface(data)
            name, dimension = "input.vtp", 3
        bare = source.NewInstance()
        bare.CopyStructure(source)
        if four is not None:
            bare.GetPointData().AddArray(source.GetPointData().GetArray("position"))
        self.write(name, bare)
        return {"dimension": dimension, "objects": [self.object({"file": name})]}, source

    def four_coordinates(self, data):
        """An array (n, 4), or nothing for a body in ordinary space."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        import numpy

        named = self.get("FourthCoordinate")
        array = data.GetPointData().GetArray(named or "position")
        if array is None and named:
            known = [data.GetPointData().GetArrayName(i) for i in range(data.GetPointData().GetNumberOfArrays())]
            raise Refused("ao4d: there is no point array %s; there are %s" % (named, ", ".join(filter(None, known)) or "none"))
        if array is None or (array.GetNumberOfComponents() != 4 and not named):
            return None
        if array.GetNumberOfComponents() == 4:
            return vtk_to_numpy(array)
        if array.GetNumberOfComponents() != 1:
            raise Refused(
                "ao4d: the array %s has %d components; expected 4, all coordinates, or 1, the fourth" % (named, array.GetNumberOfComponents())
            )
        points = vtk_to_numpy(data.GetPoints().GetData())
        return numpy.column_stack([points, vtk_to_numpy(array)])

    def images(self, steps, times):
        """The scene of images over time, or of one image."""
        name = self.get("Image") or (steps[0].GetPointData().GetScalars() and steps[0].GetPointData().GetScalars().GetName())
        array = steps[0].GetPointData().GetArray(name) if name else None
        if array is None:
            raise Refused("ao4d: choose the point array whose isosurface it is: the property Image Array")
        if array.GetNumberOfComponents() != 1:
            raise Refused("ao4d: the array %s has %d components; choose one with a number a point" % (name, array.GetNumberOfComponents()))
        files = []
        for number, step in enumerate(steps):
            bare = vtkImageData()
            bare.CopyStructure(step)
            bare.GetPointData().AddArray(step.GetPointData().GetArray(name))
            files.append("image_%04d.vti" % number)
            self.write(files[-1], bare)
        image = {"file": files[0], "array": name}
        if len(steps) > 1:
            rows = "".join('<DataSet timestep="%r" file="%s"/>' % row for row in zip(times, files))
            text = '<VTKFile type="Collection" version="0.1"><Collection>%s</Collection></VTKFile>' % rows
            write_if_new(os.path.join(self._folder, "images.pvd"), text.encode())
            pace = (times[-1] - times[0]) / (len(times) - 1) * self.get("TimeScale", 1.0)
            image = {"file": "images.pvd", "array": name, "spacing": list(steps[0].GetSpacing()) + [pace]}
        surface = {"field": {"image": image}, "isovalue": self.get("Isovalue", 0.5)}
        return {"dimension": 4 if len(steps) > 1 else 3, "objects": [self.object({"isosurface": surface})]}

    def write(self, name, data):
        """Writes an input of the program, unless it is there already: unchanged inputs are not read again."""
        from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

        writers = {"vti": vtkXMLImageDataWriter, "vtp": vtkXMLPolyDataWriter, "vtu": vtkXMLUnstructuredGridWriter}
        writer = writers[name[-3:]]()
        writer.SetInputData(data)
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToNone()
        writer.WriteToOutputStringOn()
        writer.Write()
        write_if_new(os.path.join(self._folder, name), writer.GetOutputString().encode("latin-1"))


def write_if_new(path, content):
    """Writes a file, unless it has this content."""
    if os.path.isfile(path):
        with open(path, "rb") as file:
            if hashlib.sha256(file.read()).digest() == hashlib.sha256(content).digest():
                return
    with open(path, "wb") as file:
        file.write(content)


def tetrahedra(data, four):
    """The tetrahedra of a grid, with all coordinates in the array `position`; anything else that fills space is cut into such."""
    import numpy
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import VTK_TETRA
    from vtkmodules.vtkFiltersGeneral import vtkDataSetTriangleFilter

    kept = data.NewInstance()
    kept.ShallowCopy(data)
    position = numpy_to_vtk(numpy.ascontiguousarray(four, dtype=numpy.float32), deep=True)
    position.SetName("position")
    kept.GetPointData().AddArray(position)
    kinds = vtk_to_numpy(data.GetCellTypesArray()) if data.IsA("vtkUnstructuredGrid") and data.GetNumberOfCells() else numpy.array([0])
    if (kinds == VTK_TETRA).all():
        return kept
    cut = vtkDataSetTriangleFilter()
    cut.SetInputData(kept)
    cut.TetrahedraOnlyOn()
    cut.Update()
    if not cut.GetOutput().GetNumberOfCells():
        raise Refused("ao4d: no cell is a tetrahedron or can be cut into such; in 4D, surfaces are made of tetrahedra")
    return cut.GetOutput()


def surface(data):
    """The outer surface as triangles, with the points' arrays."""
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    outer = vtkDataSetSurfaceFilter()
    outer.SetInputData(data)
    triangles = vtkTriangleFilter()
    triangles.SetInputConnection(outer.GetOutputPort())
    triangles.PassLinesOff()
    triangles.PassVertsOff()
    triangles.Update()
    if not triangles.GetOutput().GetNumberOfCells():
        raise Refused("ao4d: there is no surface; the input has no cells with an area")
    return triangles.GetOutput()


def hand_on(source, mesh):
    """Gives the points of the mesh the arrays of the input's points at the same places."""
    import numpy
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    def rows(data):
        array = data.GetPointData().GetArray("position")
        table = vtk_to_numpy(array if array is not None else data.GetPoints().GetData()).astype(numpy.float32)
        table = numpy.ascontiguousarray(table + 0.0)  # one zero, not two
        return table.view([("", table.dtype)] * table.shape[1]).ravel()

    # In 3D the input's own array of that name, if any, is something else.
    ours, theirs = rows(mesh), rows(source)
    if ours.dtype != theirs.dtype:
        return
    order = numpy.argsort(theirs, kind="stable")
    place = numpy.searchsorted(theirs, ours, sorter=order)
    nearest = order[numpy.minimum(place, len(order) - 1)]
    if not (theirs[nearest] == ours).all():
        return
    taken = {mesh.GetPointData().GetArrayName(i) for i in range(mesh.GetPointData().GetNumberOfArrays())}
    for i in range(source.GetPointData().GetNumberOfArrays()):
        array = source.GetPointData().GetArray(i)
        if array is not None and array.GetName() and array.GetName() not in taken:
            copy = numpy_to_vtk(numpy.ascontiguousarray(vtk_to_numpy(array)[nearest]), deep=True)
            copy.SetName(array.GetName())
            mesh.GetPointData().AddArray(copy)


# ------------------------------------------------------------------------------------------------------------ in ParaView itself


def show_colours_as_they_are():
    """Pictures have colours already; ParaView would put its colour map in their place. Only the client knows representations."""
    try:
        from paraview import servermanager, simple
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager
    except ImportError:
        return
    known = set()

    def show_as_it_is(representation, source):
        colours, opacity = simple.GetColorTransferFunction("rgba"), simple.GetOpacityTransferFunction("rgba")
        colours.AutomaticRescaleRangeMode = "Never"
        colours.RescaleTransferFunction(0, 255)
        opacity.Points = [0, 0, 0.5, 0, 255, 1, 0.5, 0]
        representation.LookupTable, representation.ScalarOpacityFunction = colours, opacity
        representation.ColorArrayName = ["POINTS", "rgba"]
        representation.MapScalars = 0
        bounds, extent = source.GetDataInformation(0).GetBounds(), source.GetDataInformation(0).GetExtent()
        width, cells = bounds[1] - bounds[0], extent[1] - extent[0]
        if width > 0 and cells > 0:
            representation.ScalarOpacityUnitDistance = width / cells

    def registered(manager, event):
        session = manager.GetActiveSessionProxyManager()
        for i in range(session.GetNumberOfProxies("representations") if session else 0):
            proxy = session.GetProxy("representations", session.GetProxyName("representations", i))
            source = proxy and proxy.GetProperty("Input") and proxy.GetProperty("Input").GetProxy(0)
            if not source or proxy.GetGlobalIDAsString() in known or source.GetXMLName() not in ("ao4dPicture", "ao4dFilm"):
                continue
            known.add(proxy.GetGlobalIDAsString())
            show_as_it_is(servermanager._getPyProxy(proxy), source)

    manager = vtkSMProxyManager.GetProxyManager() if vtkSMProxyManager.IsInitialized() else None
    if manager:
        manager.AddObserver("RegisterEvent", registered)


if __name__ in ("__main__", "__vtkconsole__"):
    from paraview.simple import LoadPlugin

    LoadPlugin(os.path.abspath(__file__), remote=False)
else:
    show_colours_as_they_are()
