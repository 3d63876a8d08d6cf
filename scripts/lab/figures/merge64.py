"""Seconds and peak memory of merging 64 shards, two iterations each, against one shard's.

Matte blocks at 1280 x 720 by `path` and by `vcm`.
Shards hold the layers that a farm asks for; the merge makes all of them. A merge of one shard alone (--partial) tells
what a merge costs whatever the number of shards.
"""

import shutil

from ..cache import BIN
from ..options import options as given
from ..processes import spent
from ..record import ROOT, record

OUT = ROOT / "out" / "merge64"
SCENE = ROOT / "scenes" / "blocks.glb"
ARGUMENTS = {"methods": ["path", "vcm"], "shards": 64, "width": 1280, "height": 720}


def size():
    """The size of all renders."""
    return ["--width", given.width, "--height", given.height]


def shard(method, index):
    """Renders a shard; what that took."""
    command = [BIN, "render", SCENE, "-o", OUT / f"{index}.exr", *size(), "--method", method, "--layers", "beauty"]
    command += [
        "--iterations",
        2 * given.shards,
        "--shard",
        f"{index}/{given.shards}",
        "--progress",
        "none",
        "--no-checkpoint",
    ]
    return spent(command)


def merge(shards, *options):
    """Merges; what that took."""
    return spent([BIN, "merge", *shards, "-o", OUT / "merged.exr", "--layers", "all", *options])


def alone(method):
    """What a shard with all layers takes, and a whole render of as many iterations with its finish."""
    words = [
        BIN,
        "render",
        SCENE,
        "-o",
        OUT / "alone.exr",
        *size(),
        "--method",
        method,
        "--progress",
        "none",
        "--no-checkpoint",
    ]
    shard = spent([*words, "--iterations", 2 * given.shards, "--shard", f"0/{given.shards}"])
    return {"layers": shard, "whole": spent([*words, "--iterations", 2])}


def main():
    for method in given.methods:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        shards = [OUT / f"{index}.exr" for index in range(given.shards)]
        runs = [shard(method, index) for index in range(given.shards)]
        middle = sorted(runs, key=lambda run: run["seconds"])[given.shards // 2]
        values = {"rule": method, "size": [given.width, given.height], "shards": given.shards, "shard": middle}
        values["shard"]["file_mib"] = round(shards[0].stat().st_size / 2**20, 1)
        values["one"] = merge(shards[:1], "--partial")
        values["all"] = merge(shards)
        values |= alone(method)
        values["picture_mib"] = round((OUT / "merged.exr").stat().st_size / 2**20, 1)
        print(values, flush=True)
        record("merge64", values)
    shutil.rmtree(OUT)
