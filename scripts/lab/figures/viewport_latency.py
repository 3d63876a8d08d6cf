"""Latency of Blender's viewport: seconds and core-seconds from a change to the first denoised picture, through `caustique
serve` as the add-on speaks it.

Rocks of 100,000 and of 1,000,000 triangles, each with a mesh of its own. A camera move comes while the last view renders.
Stores the figure `viewport` for each scene.
"""

import contextlib
import os
import queue
import statistics
import sys
import tempfile
import time

import bpy  # First, because it brings the others.

import export
import numpy as np
from caustique_addon import live, server

from .. import rocks
from ..cache import BIN
from ..options import options
from ..record import record

VENV = ".venv-bpy"
ARGUMENTS = {"largest": 1_000_000, "width": 960, "height": 540, "rounds": 10, "seed": 1}
SIZES = (100_000, 1_000_000)
PLACED = 3  # times an object is moved
DRAGGED = 20  # views while the mouse moves without a pause
MAX_WAIT = 0.3  # seconds that a view renders before the next move
FULL = 2  # moves after which the first full picture is awaited
PATIENCE = 600  # seconds to wait for any answer
# The defaults of the add-on.
WORDS = ["--light-units", "photometric", "--method", "auto", "--seed", "0", "--iterations", "64", "--shutter", "0"]


class Client:
    """Drives `caustique serve` as a viewport of Blender does, and keeps the times at which pictures arrive."""

    def __init__(self):
        self.pictures, self.answers = queue.Queue(), queue.Queue()
        self.live = live.Live(lambda name, **fields: self.server.send(name, **fields))
        self.server = server.Server(str(BIN), [], self._answered, self._shown)
        self.process = self.server._process.pid

    def _answered(self, answer):
        if answer["event"] in ("error", "ended"):
            print(f"viewport: {answer['message']}", file=sys.stderr)
        self.answers.put((time.perf_counter(), answer))
        self.live.answered(answer)

    def _shown(self, picture):
        self.pictures.put((time.perf_counter(), self.cores(), picture.about))
        self.live.shown(picture)

    def cores(self):
        """Core-seconds of the program so far."""
        with open(f"/proc/{self.process}/stat", encoding="utf-8") as file:
            fields = file.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def peak_memory(self):
        """Peak memory of the program in bytes."""
        with open(f"/proc/{self.process}/status", encoding="utf-8") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))

    def time(self, change, is_sought):
        """Makes a change; returns the seconds and core-seconds to the first picture of the view sent last that is sought."""
        before, cores = time.perf_counter(), self.cores()
        change()
        return self.wait(is_sought, before, cores)

    def wait(self, is_sought, before, cores):
        """Waits for a picture of the view sent last; returns the seconds and core-seconds since the given ones."""
        while True:
            at, spent, about = self.pictures.get(timeout=PATIENCE)
            if about["id"] == self.live._sent and is_sought(about):
                return at - before, spent - cores


def is_first(about):
    """Whether a picture is the first of its view."""
    return about["coarse"]


def is_full(about):
    """Whether a picture has all pixels."""
    return not about["coarse"]


def orbit(turn):
    """The command of the view from the scene's camera, turned around the middle by `turn` radians."""
    scene = bpy.context.scene
    depsgraph = bpy.context.evaluated_depsgraph_get()
    window = scene.camera.calc_matrix_camera(depsgraph, x=options.width, y=options.height)
    c, s = np.cos(turn), np.sin(turn)
    around = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    view = np.linalg.inv(around @ np.array(scene.camera.matrix_world))
    return {
        "camera": live.camera(view, window),
        "width": options.width,
        "height": options.height,
        "arguments": [],
    }


def summary(times):
    """Median and worst seconds, and median core-seconds."""
    seconds, cores = zip(*times)
    return {"median": statistics.median(seconds), "worst": max(seconds), "core_seconds": statistics.median(cores)}


def interact(client, path, random):
    """Loads the scene, moves camera and objects; returns the times."""
    before, cores = time.perf_counter(), client.cores()
    client.live.want(orbit(0))
    client.live.load(path, WORDS)
    first = client.wait(is_first, before, cores)
    full = client.wait(is_full, before, cores)
    loaded = next(answer for _, answer in iter(client.answers.get_nowait, None) if answer["event"] == "loaded")
    moves, fulls, placed = [], [], []
    for turn in range(1, options.rounds + 1):
        time.sleep(random.uniform(0, MAX_WAIT))
        began = time.perf_counter(), client.cores()
        moves.append(client.time(lambda: client.live.want(orbit(0.05 * turn)), is_first))
        if turn <= FULL:
            fulls.append(client.wait(is_full, *began))
    began = time.perf_counter()
    for turn in range(DRAGGED):
        client.time(lambda: client.live.want(orbit(0.05 * turn)), is_first)
    dragged = (time.perf_counter() - began) / DRAGGED
    with open(path, "rb") as file:
        place = live.exported_places(live.document(file.read()))["rock 0"]
    for _ in range(PLACED):
        place[1, 3] += 0.1
        placed.append(client.time(lambda: client.live.edit({"rock 0": live.columns(place)}), is_first))
    return {
        "load": loaded["seconds"],
        "first": first[0],
        "first_core_seconds": first[1],
        "first_full": full[0],
        "first_full_core_seconds": full[1],
        "move": summary(moves),
        "move_full": summary(fulls),
        "drag": dragged,
        "place": summary(placed),
        "coarse": client.live._coarse,
        "peak_bytes": client.peak_memory(),
    }


def measure(triangles):
    """The figure of a scene of about this number of triangles."""
    exact = rocks.build(triangles, options.seed)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "scene.glb")
        before, cores = time.perf_counter(), time.process_time()
        with contextlib.redirect_stdout(None):
            export.write(path)
        exported = time.perf_counter() - before, time.process_time() - cores
        client = Client()
        try:
            found = interact(client, path, np.random.default_rng(options.seed))
        finally:
            client.server.close()
    of = {"scene": f"{triangles:,} triangles", "triangles": exact, "width": options.width, "height": options.height}
    return of | {"export": exported[0], "export_core_seconds": exported[1], "load_average": os.getloadavg()[0]} | found


def main():
    for triangles in SIZES:
        if triangles <= options.largest:
            found = measure(triangles)
            for key, value in found.items():
                print(f"{key:<24}{value}", file=sys.stderr)
            record("viewport", found)
