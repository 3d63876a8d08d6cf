"""What an iteration takes, from a render's own history."""

import json
import os
import subprocess

from record import ROOT

WHOLE = os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")


def read(*arguments):
    """What a command says as JSON."""
    done = subprocess.run([WHOLE, *arguments, "--json"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return json.loads(done.stdout)


def iteration(program, scene, options, iterations, file):
    """Core-seconds of an iteration after the first, which is cold. Renders without combiner to a file."""
    command = [program, "render", ROOT / "scenes" / f"{scene}.glb", "-o", file, "--iterations", str(iterations), "--no-combine", "--progress", "none"]
    subprocess.run(command + options, check=True, stderr=subprocess.DEVNULL)
    history = read("info", file)["history"]
    first, last = history[0], history[-1]
    return (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])
