"""Exports the scene of this Blender to a .glb for the program, in a second Blender process.

Exporting changes the scene temporarily and runs operators. A render must do neither, because it runs in a thread beside
the interface. So the scene is copied to a file, and a second Blender exports the copy. It ignores the user's settings
and starts in a second; the first Blender stays responsive, and an export can be cancelled.
"""

import contextlib
import fnmatch
import json
import os
import queue
import sys
import threading
import time

import bpy

from .fault import Cancelled, Fault
from .process_input import ProcessInput

GLB = "scene.glb"
_HERE = os.path.dirname(os.path.abspath(__file__))
_OLDEST = (4, 2, 0)  # export.py needs the materials and the glTF exporter of this version
_AUTOEXEC = {"-y": True, "--enable-autoexec": True, "-Y": False, "--disable-autoexec": False}
_POLL_SECONDS = 0.02  # between two checks of the second Blender
_TASK_SECONDS = 0.05  # between two looks of the main thread for tasks
_tasks = queue.SimpleQueue()  # for the main thread, from the threads of renders


class Exporter:
    """A second Blender, which exports jobs one after the other, and its copy of the scene, in a folder. The second Blender
    starts with the first job."""

    def __init__(self, scene, folder, blender):
        """`blender`: another exporting program, or an empty text for this one."""
        if not blender and bpy.app.version < _OLDEST:
            raise Fault(f"Blender {bpy.app.version_string} cannot export what caustique needs",
                        "choose in the add-on's preferences, as Exporter, a Blender of 4.2 or newer, or the Python of "
                        "a virtual environment in which 'pip install bpy' has been run")
        self.scene, self.blender, self.scripts = scene, blender, scripts_allowed()
        self.source = scene.name, blender, self.scripts  # what its exports depend on, besides the scene's data
        self.blend = os.path.join(folder, "scene.blend")
        self._log = os.path.join(folder, "export.log")
        self._process = self._input = None

    def copy(self):
        """Write the scene and its data to a file. Call it in Blender's main thread. Returns warnings."""
        # Not bpy.ops.wm.save_as_mainfile, which would draw a thumbnail and call handlers.
        bpy.data.libraries.write(self.blend, {self.scene}, path_remap="ABSOLUTE")
        return [f'image "{image.name}": its changes are not saved, and the render does not see them: save or pack it'
                for image in bpy.data.images if image.is_dirty and image.packed_file is None and image.users]

    def begin(self, job):
        """Begin an export, which ends when its report is there or the second Blender has ended."""
        if self._process is None:
            self._start()
        try:
            self._input.send(json.dumps(job).encode() + b"\n")
        except OSError:  # it has ended, which `is_running` tells
            pass

    def _start(self):
        command, self._input = self._command(), ProcessInput()
        with open(self._log, "wb") as output:
            try:
                self._process = self._input.start(command, stdout=output, stderr=output)
            except OSError as error:
                raise Fault(f"{command[0]} does not run: {error.strerror}",
                            "choose another Exporter in the add-on's preferences, or none") from error

    def _command(self):
        script = os.path.join(_HERE, "export_job.py")
        program = os.path.expanduser(self.blender) or bpy.app.binary_path
        if not program or os.path.basename(program).startswith("python"):  # Blender as a module of Python
            # Isolated, because modules in the current folder may come from an untrusted source.
            return [program or sys.executable, "-I", script]
        scripts = "--enable-autoexec" if self.scripts else "--disable-autoexec"
        return [program, "-b", "--factory-startup", scripts, "-noaudio", "--python", script]

    def is_running(self):
        """Whether the second Blender is running."""
        return self._process is not None and self._process.poll() is None

    def end(self):
        """End the second Blender."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._input.close()

    def last_line(self):
        """The last line of its messages."""
        with open(self._log, encoding="utf-8", errors="replace") as file:
            return (file.read().strip().splitlines() or ["it said nothing"])[-1]


class Job:
    """An export of the copied scene to the file `GLB` in a folder. `run` may be called from any thread."""

    def __init__(self, scene, view_layer, frame, folder, blender, only=None):
        """Prepare the export of `scene` at `frame` (a float) to the empty `folder`. `blender`: another exporting
        program. `only`: names of changed objects, to export them and what depends on them; None for the whole scene."""
        self.exporter = Exporter(scene, folder, blender)
        self.keeps_exporter = False  # whether `run` leaves the second Blender running
        # After `run`: names of the exported objects, or None for the whole scene; whether other frames of the copy have all
        # animated values.
        self.only, self.animates_all = None, False
        self._job = {
            "scene": scene.name, "view_layer": view_layer, "frame": frame, "only": only,
            "exporter": os.path.join(_HERE, "exporter"), "glb": os.path.join(folder, GLB),
            "report": os.path.join(folder, "report.json"), "progress": os.path.join(folder, "progress.txt"),
        }
        self._said = None

    def copy(self):
        """Write the scene and its data to a file. Call it in Blender's main thread. Returns warnings."""
        return self.exporter.copy()

    def run(self, stopped, tell=lambda text: None):
        """Export the copy. Returns the exporter's warnings. `stopped()` is polled for cancellation; `tell(text)` receives
        what the export does."""
        report = self._job["report"]
        with contextlib.suppress(FileNotFoundError):  # of an export that has failed
            os.remove(report)
        try:
            self.exporter.begin({**self._job, "blend": self.exporter.blend, "scripts": self.exporter.scripts})
            while self.exporter.is_running() and not os.path.exists(report):
                if stopped():
                    raise Cancelled()
                self._tell_progress(tell)
                time.sleep(_POLL_SECONDS)
        finally:
            if not self.keeps_exporter:
                self.exporter.end()
        return self._read(report)

    def _tell_progress(self, tell):
        try:
            with open(self._job["progress"], encoding="utf-8") as file:
                text = file.read()
        except OSError:  # nothing yet
            return
        if text != self._said:
            self._said = text
            tell(text)

    def _read(self, path):
        try:
            with open(path, encoding="utf-8") as file:
                report = json.load(file)
        except OSError:
            report = {"error": self.exporter.last_line()}
        if "error" in report:
            place = report.get("place")
            raise Fault(f"the scene could not be exported: {report['error']}",
                        f"this is a fault of caustique's exporter ({place}): report it with the scene" if place else
                        "try File > Export > glTF 2.0, which shows what it stumbles over")
        self.only, self.animates_all = report["only"], report["animates_all"]
        return report["warnings"]


def scripts_allowed():
    """Whether Python in the file may run in the second Blender.

    It may if the preferences or the command line allow scripts in general, and they were not blocked in this file.
    """
    preferences = bpy.context.preferences
    allowed = preferences.filepaths.use_scripts_auto_execute
    for word in sys.argv[:sys.argv.index("--") if "--" in sys.argv else None]:
        if word in _AUTOEXEC:
            allowed = _AUTOEXEC[word]
    # Blender sets autoexec_fail only after it blocked a script, which never happens for hidden objects.
    return allowed and not bpy.app.autoexec_fail and not any(map(_lies_in, preferences.autoexec_paths))


def _lies_in(excluded):
    """Whether the file is in a folder that the preferences exclude from running scripts."""
    if not excluded.path or not bpy.data.filepath:
        return False
    if excluded.use_glob:
        return fnmatch.fnmatch(bpy.data.filepath, excluded.path)
    return os.path.realpath(bpy.data.filepath).startswith(os.path.join(os.path.realpath(excluded.path), ""))


def in_main_thread(work, stopped):
    """Call `work` in Blender's main thread, from the thread of a render. Returns its result."""
    if threading.current_thread() is threading.main_thread():
        return work()
    done, cancelled, outcome = threading.Event(), threading.Event(), {}

    def task():
        if not cancelled.is_set():
            try:
                outcome["value"] = work()
            except Exception as error:  # the waiting thread raises it
                outcome["error"] = error
        done.set()

    _tasks.put(task)
    # While Blender waits for a cancelled render, its timers do not run.
    while not done.wait(_POLL_SECONDS):
        if stopped():
            cancelled.set()
            raise Cancelled()
    if "error" in outcome:
        raise outcome["error"]
    return outcome["value"]


def run_tasks():
    """Run the tasks that `in_main_thread` has left, in the main thread. Returns the seconds until the next call."""
    while not _tasks.empty():
        _tasks.get()()
    return _TASK_SECONDS


def register():
    """Start the timer of `run_tasks`.

    It runs all the time, because only the main thread may add a timer: Blender's list of timers has no lock, and an
    addition while the main thread removes another timer loses timers, also those of other add-ons.
    """
    bpy.app.timers.register(run_tasks, persistent=True)


def unregister():
    """Stop the timer."""
    if bpy.app.timers.is_registered(run_tasks):
        bpy.app.timers.unregister(run_tasks)
