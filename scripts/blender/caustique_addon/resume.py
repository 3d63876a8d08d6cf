"""Checkpoints of renders: if the user stops a render or Blender is killed, the next F12 of the same scene and settings goes
on with the render.

A checkpoint is in the user's cache folder, named by a digest of the exported scene and of the command line. It is removed
when the render ends by itself.
"""

import hashlib
import os
import signal
import time

_SECONDS_BETWEEN = 60  # between two checkpoints of a render
_MAX_AGE_DAYS = 7
_MAX_KEPT = 2  # checkpoints of other renders, which may take gigabytes
_CLOCK_SECONDS = 0.1  # precision of the times of files
_SUFFIX, _PROCESS = ".checkpoint", ".process"
_OWN_FILES = {"export.log", "report.json", "progress.txt", "scene.blend"}


def _folder():
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return os.path.join(base, "caustique", "renders")


class Checkpoint:
    """The checkpoint of one render: the command line `words` in the folder of the exported scene."""

    def __init__(self, words, folder):
        total = hashlib.sha256(repr(words).encode())
        for name in sorted(set(os.listdir(folder)) - _OWN_FILES):
            with open(os.path.join(folder, name), "rb") as file:
                total.update(name.encode() + file.read())
        self.path = os.path.join(_folder(), total.hexdigest()[:40] + _SUFFIX)
        self._stopped_at = None  # when the user stopped the render

    def exists(self):
        """Whether a checkpoint exists from which this render can continue."""
        return os.path.isfile(self.path)

    def stopped(self):
        """Note that the user stops the render, whose state is saved from now on. It may be called repeatedly."""
        if self._stopped_at is None:
            self._stopped_at = time.time()

    def is_saved(self):
        """Whether the program has saved the state since the user stopped the render."""
        try:
            return os.stat(self.path).st_mtime >= self._stopped_at - _CLOCK_SECONDS
        except OSError:
            return False

    def end(self):
        """Remove the checkpoint if the render has ended by itself, and keep it if the user has stopped it."""
        if self._stopped_at is None:
            self.remove()

    def options(self):
        """Options that save the render here, and go on with what is saved here."""
        try:
            os.makedirs(_folder(), mode=0o700, exist_ok=True)
            _remove_old(self.path)
            self._end_orphan()
        except OSError:  # a render without a checkpoint is better than none
            return []
        goes_on = ["--resume", self.path] if self.exists() else []
        return ["--checkpoint", self.path, "--checkpoint-every", str(_SECONDS_BETWEEN), *goes_on]

    def started(self, process):
        """Note the process that renders, in case Blender is killed and leaves it behind."""
        try:
            with open(self.path + _PROCESS, "w", encoding="utf-8") as file:
                file.write(str(process))
        except OSError:
            pass

    def _end_orphan(self):
        """End the process of a killed Blender that still renders to this checkpoint: nobody reads its picture."""
        process = _process_of(self.path)
        if process is not None:
            os.kill(process, signal.SIGKILL)

    def remove(self):
        """Remove the checkpoint, because its render has ended."""
        for path in (self.path, self.path + _PROCESS):
            try:
                os.remove(path)
            except OSError:
                pass


def _process_of(path):
    """The process that renders to the checkpoint `path`; None if there is none."""
    try:
        with open(path + _PROCESS, encoding="utf-8") as file:
            process = int(file.read())
        with open(f"/proc/{process}/cmdline", "rb") as file:
            return process if path.encode() in file.read().split(b"\0") else None
    except (OSError, ValueError):
        return None


def _remove_old(path):
    """Remove checkpoints of other renders than that of `path`: old ones, and all but the newest that no process uses."""
    kept = []
    for entry in os.scandir(_folder()):
        if time.time() - entry.stat().st_mtime > _MAX_AGE_DAYS * 86400:
            os.remove(entry.path)
        elif entry.name.endswith(_SUFFIX) and entry.path != path and _process_of(entry.path) is None:
            kept.append((entry.stat().st_mtime, entry.path))
    for _, other in sorted(kept, reverse=True)[_MAX_KEPT:]:
        os.remove(other)
