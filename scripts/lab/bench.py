"""Figures that a bench of Cargo (tests/bench) measures: the last line of its output is stored."""

import json
import subprocess

from .record import ROOT, record


def lines(bench, *arguments):
    """Runs a bench; returns the lines of its output."""
    command = ["cargo", "bench", "--locked", "--quiet", "--bench", bench, "--", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return done.stdout.splitlines()


def measure(bench, name, *arguments):
    """Prints the output of a bench, and stores its last line as a figure."""
    *shown, last = lines(bench, *arguments)
    print("\n".join(shown))
    record(name, json.loads(last))
