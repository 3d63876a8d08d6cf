"""Core-seconds of an iteration with five levels on the interior scene, by phase, and the cost of levels and of the second
camera path."""

from ..bench import measure
from ..options import options

ARGUMENTS = {"rounds": 3}


def main():
    measure("iteration", "interior-iteration", "scenes/interior.glb", 1280, options.rounds)
