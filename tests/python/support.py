"""Where the program, the scenes and scratch space are, and how to run the program."""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Folders whose modules tests import. Scripts themselves start in their own folder.
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

    `check`: the exit code to insist on; an AssertionError shows what the program said. `timeout`: seconds. `env`:
    variables to add; None as a value removes one.
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
    """The path of a scene of ours: scene("torus") is scenes/torus.glb."""
    path = ROOT / "scenes" / name
    if not path.suffix:
        path = path.with_suffix(".glb")
    if not path.is_file():
        raise FileNotFoundError(path)
    return path


class Scratch(unittest.TestCase):
    """A test case with an empty folder of its own, `self.dir`, removed afterwards."""

    def setUp(self):
        super().setUp()
        folder = tempfile.TemporaryDirectory(prefix="caustique-")
        self.addCleanup(folder.cleanup)
        self.dir = Path(folder.name)
