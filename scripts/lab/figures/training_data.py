"""Renders the training data of the combiner or, with --finish, of the network of the finish: random scenes in families,
at the lowest priority. A repeated run continues where the last one stopped, and renders with the same copy of the program.

A view takes about a core-minute, of one thread. Training can start on the views that are finished. With --part 1/2 and
--part 2/2, two runs render different views at the same time.
"""

import os
from pathlib import Path

from ..cache import BIN, CACHE, Failed
from ..options import options
from ..train import data, finish_data

FOLDER, FINISH_FOLDER = CACHE / "training", CACHE / "training-finish"


def add_arguments(parser):
    parser.add_argument("--finish", action="store_true", help="data for the network of the finish")
    parser.add_argument("--folder", type=Path, help=f"folder of the data [default: {FOLDER}, {FINISH_FOLDER}]")
    parser.add_argument("--views", type=int, default=5, help="views of each family [default: 5]")
    parser.add_argument("--only", help="a family to render alone")
    parser.add_argument("--part", type=part, default=(1, 1), help="I/N: every Nth view, from the Ith on [default: 1/1]")


def part(text):
    """The numbers of I/N."""
    one, many = map(int, text.split("/"))
    if not 1 <= one <= many:
        raise ValueError(text)
    return one, many


def main():
    os.nice(19)
    kind = finish_data if options.finish else data
    folder = options.folder or (FINISH_FOLDER if options.finish else FOLDER)
    maker = kind.Maker(folder, BIN)
    first, step = options.part
    chosen = data.views(folder, options.views, kind.View)[first - 1 :: step]
    chosen = [view for view in chosen if options.only in (None, view.family)]
    done = data.manifest(folder)
    for view in chosen:
        if view.name in done:
            continue
        try:
            maker.make(view)
            print(f"{view.name}: done", flush=True)
        except Failed as failed:
            print(f"{view.name}: {failed}", flush=True)
