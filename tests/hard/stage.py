"""Where cases are played: runs the program, and keeps the pictures of a case while it is judged."""

import subprocess
import time
from pathlib import Path

import numpy as np
import OpenEXR

from .case import PHOTON_METHODS

#: Seconds after which a render counts as hanging.
PATIENCE = 60


class Broken(Exception):
    """A render that ended with an error, or not at all; the message is what the program said."""


class Stage:
    """Plays one case with one method. folder: where scenes and pictures go."""

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
        """The path of a scene of the case, which Case.write() has written."""
        return self.folder / self.case.file(label)

    def picture(self, name):
        """The path of a picture of this case and method."""
        return self.folder / "pictures" / f"{self.case.name}-{self.method}-{name}.exr"

    def clear(self):
        """Removes the pictures of this case and method."""
        for path in self.folder.glob(f"pictures/{self.case.name}-{self.method}-*"):
            path.unlink()

    def run(self, *arguments, stop_after=None):
        """Runs the program; (exit code, what it said on stderr). stop_after: seconds until it is killed."""
        command = [str(self.program), *map(str, arguments)]
        self.commands.append(command)
        started = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            try:
                said = process.communicate(timeout=stop_after or PATIENCE)[1]
            except subprocess.TimeoutExpired:
                process.kill()
                said = process.communicate()[1]
                if stop_after is None:
                    raise Broken(f"did not end within {PATIENCE} s: {' '.join(command)}") from None
        self.seconds += time.monotonic() - started
        return process.returncode, said

    def arguments(self, label, seed, threads=None):
        """The arguments of a render of a scene, but for its output."""
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
        """Renders a scene into the file that is returned."""
        path = self.picture(name or f"{label}-{seed}")
        code, said = self.run(*self.arguments(label, seed, threads), *more, "-o", path)
        self.said += said
        if code:
            raise Broken(said.strip() or f"exit code {code}")
        return path

    def pictures(self, label):
        """The pictures of a scene, one for each seed of the case: (seeds, height, width, 3)."""
        if label not in self.kept:
            self.kept[label] = np.stack([read(self.render(label, seed)) for seed in range(self.case.seeds)])
        return self.kept[label]


def read(path):
    """The root picture of an EXR: (height, width, 3), single precision."""
    channels = OpenEXR.File(str(path)).channels()
    if "RGBA" in channels:
        return channels["RGBA"].pixels[..., :3]
    if "RGB" in channels:
        return channels["RGB"].pixels
    return np.stack([channels[c].pixels for c in "RGB"], axis=-1)
