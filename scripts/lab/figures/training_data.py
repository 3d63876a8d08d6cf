"""Renders the training data of the combiner: random scenes in families, at the lowest priority. A repeated run
continues where the last one stopped, and renders with the same copy of the program.

It takes about eight core-hours on one thread; training can start on the views that are finished.
"""

import os
from pathlib import Path

from ..cache import BIN, CACHE, Failed
from ..options import options
from ..train import data

FOLDER = CACHE / "training"


def add_arguments(parser):
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"folder of the data [default: {FOLDER}]")
    parser.add_argument("--views", type=int, default=5, help="views of each family [default: 5]")
    parser.add_argument("--only", help="a family to render alone")


def main():
    os.nice(19)
    maker = data.Maker(options.folder, BIN)
    chosen = [view for view in data.views(options.folder, options.views) if options.only in (None, view.family)]
    done = data.manifest(options.folder)
    for view in chosen:
        if view.name in done:
            continue
        try:
            maker.make(view)
            print(f"{view.name}: done", flush=True)
        except Failed as failed:
            print(f"{view.name}: {failed}", flush=True)
