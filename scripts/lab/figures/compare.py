"""The comparison scenes in caustique and in Mitsuba 3: ratios of means and of tiles.

The last two runs show the effect of --correct: the scene of wide lobes with and without corrections of Mitsuba's models.
Pictures of the differences are written to out/compare.
"""

import json
import subprocess

import tiles

from ..commands import command
from ..options import options
from ..record import ROOT, record

VENV = ".venv-compare"
ARGUMENTS = {"width": 160, "seeds": 8}
FOLDER = ROOT / "out" / "compare"
# Scene, Mitsuba's samples per pixel, more options.
RUNS = [
    ("glass", 144, []),
    ("frosted", 112, ["--correct"]),
    ("metal", 40, ["--correct"]),
    ("textures", 112, ["--correct"]),
    ("wide", 40, ["--correct"]),
    ("wide", 40, []),
]


def main():
    python = ROOT / VENV / "bin" / "python"
    subprocess.run([python, "-m", "lab.compare_scenes", FOLDER], check=True)
    for scene, spp, more in RUNS:
        name = f"{scene}-corrected" if more else scene
        program = ROOT / "scripts" / "compare" / "mitsuba.py"
        settings = {"width": options.width, "seeds": options.seeds, "spp": spp, "png": FOLDER / f"{name}.png"}
        line = command(FOLDER / f"{scene}.glb", *more, program=program, **settings, json=True)
        done = subprocess.run(line, check=True, stdout=subprocess.PIPE, text=True)
        values = json.loads(done.stdout)
        print(tiles.table(values), flush=True)
        record("mitsuba", values)
