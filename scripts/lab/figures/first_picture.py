"""Seconds from opening a .blend to its first finished picture, by F12, `caustique render` and the viewport, and the size
of the default EXR with the seconds to write it.

Blender and the add-on run already, as in an artist's session; the viewport's first coarse picture is timed, too. The
scenes are those of scenes/blender.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..cache import BIN, program
from ..commands import command, read
from ..options import options
from ..record import ROOT, record

VENV = ".venv-bpy"
ARGUMENTS = {"scenes": ["jewellery", "water", "dam"], "width": 640, "iterations": 16, "threads": 2}


def height():
    """The height of the pictures, 16 to 9."""
    return options.width * 9 // 16


def session(path, blend):
    """Runs blender_session.py; returns its times."""
    script = Path(__file__).parents[1] / "blender_session.py"
    size = [str(options.width), str(height())]
    words = [sys.executable, str(script), path, str(BIN), str(blend), str(options.iterations), *size]
    modules = {"PYTHONPATH": str(ROOT / "scripts" / "blender")}
    done = subprocess.run(words, env=os.environ | modules, capture_output=True, text=True)
    found = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not found:
        sys.exit(f"first_picture: error: {path} of {blend.name} failed\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return json.loads(found[-1])


def alone(blend, folder):
    """Seconds of `caustique render`, and the seconds to finish and write the EXR and its size in MB."""
    picture = folder / "picture.exr"
    size = {"width": options.width, "threads": options.threads}
    line = command("render", blend, "-o", picture, iterations=options.iterations, progress="none", **size)
    start = time.monotonic()
    subprocess.run(line, check=True, capture_output=True)
    spent = time.monotonic() - start
    phases = read("info", picture)["phases"]
    return spent, phases, picture.stat().st_size / 1e6


def measure(name):
    """The row of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        blend = Path(folder) / f"{name}.blend"
        script = ROOT / "scenes" / "blender" / f"{name}.py"
        subprocess.run([sys.executable, str(script), str(blend)], check=True, capture_output=True)
        spent, phases, size = alone(blend, Path(folder))
        shown = session("viewport", blend)
        return {
            "scene": name,
            "render": round(spent, 1),
            "f12": round(session("f12", blend)["finished"], 1),
            "viewport_coarse": round(shown["coarse"], 1),
            "viewport": round(shown["finished"], 1),
            "phases": phases,
            "exr_mb": round(size, 1),
        }


def main():
    rows = []
    print(f"{'seconds':<12}{'render':>8}{'F12':>8}{'viewport: coarse':>18}{'whole':>8}{'EXR, MB':>10}")
    for name in options.scenes:
        row = measure(name)
        rows.append(row)
        line = f"{name:<12}{row['render']:>8}{row['f12']:>8}{row['viewport_coarse']:>18}{row['viewport']:>8}"
        print(f"{line}{row['exr_mb']:>10}  {row['phases']}", flush=True)
    size = {key: getattr(options, key) for key in ("width", "iterations", "threads")}
    record("first_picture", {"program": program(), **size, "rows": rows})
