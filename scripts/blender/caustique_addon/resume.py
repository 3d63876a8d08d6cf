"""Checkpoints of renders: if Blender is killed, the next F12 of the same scene and settings goes on with the render.

A checkpoint is in the user's cache folder, named by a digest of the exported scene and of the command line. It is removed
when the render ends or the user stops it.
"""

import hashlib
import os
import signal
import time

_SECONDS_BETWEEN = 60  # between two checkpoints of a render
_MAX_AGE_DAYS = 7
_OWN_FILES = {"job.json", "export.log", "report.json", "progress.txt", "scene.blend"}


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
        self.path = os.path.join(_folder(), total.hexdigest()[:40] + ".checkpoint")

    def options(self):
        """Options that save the render here, and go on with what is saved here."""
        try:
            os.makedirs(_folder(), mode=0o700, exist_ok=True)
            _remove_old()
            self._end_orphan()
        except OSError:  # a render without a checkpoint is better than none
            return []
        goes_on = ["--resume", self.path] if os.path.isfile(self.path) else []
        return ["--checkpoint", self.path, "--checkpoint-every", str(_SECONDS_BETWEEN), *goes_on]

    def started(self, process):
        """Note the process that renders, in case Blender is killed and leaves it behind."""
        try:
            with open(self.path + ".process", "w", encoding="utf-8") as file:
                file.write(str(process))
        except OSError:
            pass

    def _end_orphan(self):
        """End the process of a killed Blender that still renders to this checkpoint: nobody reads its picture."""
        try:
            with open(self.path + ".process", encoding="utf-8") as file:
                process = int(file.read())
            with open(f"/proc/{process}/cmdline", "rb") as file:
                renders = self.path.encode() in file.read().split(b"\0")
        except (OSError, ValueError):
            return
        if renders:
            os.kill(process, signal.SIGKILL)

    def remove(self):
        """Remove the checkpoint, because its render has ended."""
        for path in (self.path, self.path + ".process"):
            try:
                os.remove(path)
            except OSError:
                pass


def _remove_old():
    for entry in os.scandir(_folder()):
        if time.time() - entry.stat().st_mtime > _MAX_AGE_DAYS * 86400:
            os.remove(entry.path)
