"""What iterations take, from a render's own history."""

import json
import os
import subprocess

from record import ROOT

WHOLE = os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")


def read(*arguments):
    """What a command says as JSON."""
    done = subprocess.run([WHOLE, *arguments, "--json"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return json.loads(done.stdout)


def history(program, scene, options, iterations, file):
    """Renders without combiner to a file; returns the entries of its history."""
    command = [program, "render", ROOT / "scenes" / f"{scene}.glb", "-o", file, "--iterations", str(iterations), "--no-combine", "--progress", "none"]
    subprocess.run(command + options, check=True, stderr=subprocess.DEVNULL)
    return read("info", file)["history"]


def iteration(program, scene, options, iterations, file):
    """Core-seconds of an iteration after the first, which is cold."""
    first, *_, last = history(program, scene, options, iterations, file)
    return (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])
