"""Writes the scene of one view: FAMILY INDEX ATTEMPT FILE.glb."""

import importlib
import os
import sys

import build as b
import numpy as np

from . import module_of


def main():
    family, index, attempt, path = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    b.start(1280, 720)
    module = importlib.import_module(f".{module_of(family)}", __package__)
    getattr(module, family)(np.random.default_rng([index, attempt, *family.encode()]))
    b.export.write(path)
    sys.stdout.flush()
    # Blender as a module may hang while it shuts down.
    os._exit(0)


main()
