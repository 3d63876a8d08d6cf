"""Exports the scene of this Blender to a .glb for the program, in a second Blender process.

Exporting changes the scene temporarily and runs operators. A render must do neither, because it runs in a thread beside
the interface. So the scene is copied to a file, and a second Blender exports the copy. It ignores the user's settings
and starts in a second; the first Blender stays responsive, and an export can be cancelled.
"""

import fnmatch
import json
import os
import queue
import subprocess
import sys
import threading
import time

import bpy

from .fault import Cancelled, Fault

GLB = "scene.glb"
_HERE = os.path.dirname(os.path.abspath(__file__))
_OLDEST = (4, 2, 0)  # export.py needs the materials and the glTF exporter of this version
_AUTOEXEC = {"-y": True, "--enable-autoexec": True, "-Y": False, "--disable-autoexec": False}
_POLL_SECONDS = 0.02  # between two checks of the second Blender
_TASK_SECONDS = 0.05  # between two looks of the main thread for tasks
_tasks = queue.SimpleQueue()  # for the main thread, from the threads of renders


class Job:
    """An export to the file `GLB` in a folder. `run` may be called from any thread."""

    def __init__(self, scene, view_layer, frame, folder, blender, only=None):
        """Prepare the export of `scene` at `frame` (a float) to the empty `folder`. `blender`: another exporting
        program. `only`: names of changed objects, to export them and what depends on them; None for the whole scene."""
        if not blender and bpy.app.version < _OLDEST:
            raise Fault(f"Blender {bpy.app.version_string} cannot export what caustique needs",
                        "choose in the add-on's preferences, as Exporter, a Blender of 4.2 or newer, or the Python of "
                        "a virtual environment in which 'pip install bpy' has been run")
        self.folder = folder
        self._blender = os.path.expanduser(blender)
        self._blend = os.path.join(folder, "scene.blend")
        self._job = {
            "blend": self._blend, "scene": scene.name, "view_layer": view_layer, "frame": frame,
            "scripts": scripts_allowed(), "only": only,
            "exporter": os.path.join(_HERE, "exporter"), "glb": os.path.join(folder, GLB),
            "report": os.path.join(folder, "report.json"), "progress": os.path.join(folder, "progress.txt"),
        }
        self._scene, self._said = scene, None
        self.only = None  # after `run`: names of the exported objects, or None for the whole scene

    def copy(self):
        """Write the scene and its data to a file. Call it in Blender's main thread. Returns warnings."""
        # Not bpy.ops.wm.save_as_mainfile, which would draw a thumbnail and call handlers.
        bpy.data.libraries.write(self._blend, {self._scene}, path_remap="ABSOLUTE")
        return [f'image "{image.name}": its changes are not saved, and the render does not see them: save or pack it'
                for image in bpy.data.images if image.is_dirty and image.packed_file is None and image.users]

    def run(self, stopped, tell=lambda text: None):
        """Export the copy. Returns the exporter's warnings. `stopped()` is polled for cancellation; `tell(text)` receives
        what the export does."""
        path = os.path.join(self.folder, "job.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(self._job, file)
        log = os.path.join(self.folder, "export.log")
        command = self._command(path)
        with open(log, "wb") as output:
            try:
                worker = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output,
                                          start_new_session=True)
            except OSError as error:
                raise Fault(f"{command[0]} does not run: {error.strerror}",
                            "choose another Exporter in the add-on's preferences, or none") from error
        try:
            while worker.poll() is None:
                if stopped():
                    raise Cancelled()
                self._tell_progress(tell)
                time.sleep(_POLL_SECONDS)
        finally:
            worker.kill()
            worker.wait()
        return self._report(log)

    def _tell_progress(self, tell):
        try:
            with open(self._job["progress"], encoding="utf-8") as file:
                text = file.read()
        except OSError:  # nothing yet
            return
        if text != self._said:
            self._said = text
            tell(text)

    def _command(self, job):
        script = os.path.join(_HERE, "export_job.py")
        program = self._blender or bpy.app.binary_path
        if not program or os.path.basename(program).startswith("python"):  # Blender as a module of Python
            # Isolated, because modules in the current folder may come from an untrusted source.
            return [program or sys.executable, "-I", script, job]
        scripts = "--enable-autoexec" if self._job["scripts"] else "--disable-autoexec"
        return [program, "-b", "--factory-startup", scripts, "-noaudio", "--python", script, "--", job]

    def _report(self, log):
        try:
            with open(self._job["report"], encoding="utf-8") as file:
                report = json.load(file)
        except (OSError, ValueError):
            with open(log, encoding="utf-8", errors="replace") as file:
                last = (file.read().strip().splitlines() or ["it said nothing"])[-1]
            report = {"error": last}
        if "error" in report:
            place = report.get("place")
            raise Fault(f"the scene could not be exported: {report['error']}",
                        f"this is a fault of caustique's exporter ({place}): report it with the scene" if place else
                        "try File > Export > glTF 2.0, which shows what it stumbles over")
        self.only = report["only"]
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


def without_file(line):
    """Remove the exported file's name from a message of the program, because the user does not know the file."""
    return line.replace(f"{GLB}: ", "", 1)


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
