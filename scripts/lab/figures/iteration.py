"""Core-seconds of one iteration with five levels on the interior scene, by phase, and what levels and the second camera
path add."""

from ..bench import measure
from ..options import options

ARGUMENTS = {"rounds": 3}


def main():
    measure("iteration", "interior-iteration", "scenes/interior.glb", 1280, options.rounds)
