"""Runs the program on a case, and keeps the case's pictures while they are tested."""

import subprocess
import time
from pathlib import Path

import numpy as np
import OpenEXR

from .case import PHOTON_METHODS

#: Seconds after which a render counts as hanging.
TIMEOUT = 60


class Broken(Exception):
    """A render has ended with an error, or not at all; the text is the program's message."""


class Stage:
    """Renders one case by one method; folder: of scenes and pictures."""

    def __init__(self, program, folder, case, method, threads=1):
        self.program, self.folder, self.case, self.method, self.threads = (
            Path(program),
            Path(folder),
            case,
            method,
            threads,
        )
        self.kept, self.commands, self.seconds, self.said = {}, [], 0.0, ""
        (self.folder / "pictures").mkdir(parents=True, exist_ok=True)

    def scene(self, label):
        """The path of a scene of the case (Case.write() writes it)."""
        return self.folder / self.case.file(label)

    def picture(self, name):
        """The path of a picture of this case and method."""
        return self.folder / "pictures" / f"{self.case.name}-{self.method}-{name}.exr"

    def clear(self):
        """Removes the pictures of this case and method."""
        for path in self.folder.glob(f"pictures/{self.case.name}-{self.method}-*"):
            path.unlink()

    def run(self, *arguments, stop_after=None):
        """Runs the program; returns its exit code and its stderr. stop_after: seconds after which it is killed."""
        command = [str(self.program), *map(str, arguments)]
        self.commands.append(command)
        started = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            try:
                said = process.communicate(timeout=stop_after or TIMEOUT)[1]
            except subprocess.TimeoutExpired:
                process.kill()
                said = process.communicate()[1]
                if stop_after is None:
                    raise Broken(f"did not end within {TIMEOUT} s: {' '.join(command)}") from None
        self.seconds += time.monotonic() - started
        return process.returncode, said

    def arguments(self, label, seed, threads=None):
        """The arguments of a render of a scene, without its output."""
        case, size = self.case, str(self.case.size)
        photons = ["--photons", case.of("photons", self.method)] if self.method in PHOTON_METHODS else []
        return [
            "render",
            self.scene(label),
            "--method",
            self.method,
            "--width",
            size,
            "--height",
            size,
            "--iterations",
            case.of("iterations", self.method),
            "--seed",
            seed,
            "--threads",
            threads or self.threads,
            *photons,
            "--no-combine",
            "--layers",
            "beauty",
            "--reproducible",
            "--progress",
            "none",
            "--no-checkpoint",
            *case.of("options", self.method),
        ]

    def render(self, label, seed, *more, name=None, threads=None):
        """Renders a scene; returns the file of the picture."""
        path = self.picture(name or f"{label}-{seed}")
        code, said = self.run(*self.arguments(label, seed, threads), *more, "-o", path)
        self.said += said
        if code:
            raise Broken(said.strip() or f"exit code {code}")
        return path

    def pictures(self, label):
        """The pictures of a scene for all seeds of the case, of shape (seeds, height, width, 3)."""
        if label not in self.kept:
            self.kept[label] = np.stack([read(self.render(label, seed)) for seed in range(self.case.seeds)])
        return self.kept[label]


def read(path):
    """The root layer of an EXR, of shape (height, width, 3), in single precision."""
    channels = OpenEXR.File(str(path)).channels()
    if "RGBA" in channels:
        return channels["RGBA"].pixels[..., :3]
    if "RGB" in channels:
        return channels["RGB"].pixels
    return np.stack([channels[c].pixels for c in "RGB"], axis=-1)
