"""Runs tests/bench/rules, which measures the bandwidth rules inside the library, for the figures about them."""

import functools
import json
import subprocess

from .options import options
from .record import ROOT


@functools.cache
def executable():
    """Builds the bench and returns its path."""
    command = ["cargo", "bench", "--bench", "rules", "--no-run", "--message-format=json"]
    found = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = map(json.loads, found.splitlines())
    return next(m["executable"] for m in messages if m.get("target", {}).get("name") == "rules" and m.get("executable"))


def run(figure, **options):
    """Runs a figure of the bench; returns the JSON object that it prints."""
    command = [executable(), figure, *(f"{key}={value}" for key, value in options.items())]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout)


def bench_options():
    """The options that most figures of the bench take, from the arguments."""
    return {
        "iterations": options.iterations,
        "seeds": options.seeds,
        "width": options.width,
        "photons": options.photons[0],
        "reference": f"{options.reference_seconds:g}",
    }
