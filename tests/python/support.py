"""Paths of the program and the scenes, temporary folders, and running the program."""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Folders of modules that tests import. Scripts start in their own folder.
MODULES = ("", "scripts", "scripts/blender", "scripts/compare/peers", "scripts/farm", "scripts/usd")
sys.path += [str(ROOT / folder) for folder in MODULES]


def binary():
    """The program: $CAUSTIQUE_BIN, or the release build."""
    path = Path(os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique"))
    if not path.is_file():
        raise FileNotFoundError(f"{path}: not built; run 'cargo build --release' or set CAUSTIQUE_BIN")
    return path


def run(args, *, check=None, timeout=300, cwd=None, env=None):
    """Runs the program with `args` and returns the CompletedProcess, its output as text.

    `check`: expected exit code; an AssertionError shows the program's output. `timeout`: seconds. `env`: environment
    variables to add; the value None removes one.
    """
    variables = dict(os.environ)
    for name, value in (env or {}).items():
        if value is None:
            variables.pop(name, None)
        else:
            variables[name] = str(value)
    command = [str(binary()), *map(str, args)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=timeout, cwd=cwd, env=variables, check=False
    )
    if check is not None and done.returncode != check:
        raise AssertionError(
            f"{' '.join(command)}\nexit code {done.returncode}, expected {check}\n{done.stdout}{done.stderr}"
        )
    return done


def scene(name):
    """The path of a scene of the project: scene("torus") is scenes/torus.glb."""
    path = ROOT / "scenes" / name
    if not path.suffix:
        path = path.with_suffix(".glb")
    if not path.is_file():
        raise FileNotFoundError(path)
    return path


class Scratch(unittest.TestCase):
    """A test case with a temporary folder, `self.dir`."""

    def setUp(self):
        super().setUp()
        folder = tempfile.TemporaryDirectory(prefix="caustique-")
        self.addCleanup(folder.cleanup)
        self.dir = Path(folder.name)
