#!/usr/bin/env python3
"""Seconds and peak memory of merging 64 shards, two iterations each, against one shard's.

Matte blocks at 1280 x 720 by `path` and by `vcm` (METHODS); SHARDS (64), WIDTH (1280) and HEIGHT (720) shorten a trial.
Shards hold the layers that a farm asks for; the merge makes all of them. A merge of one shard alone (--partial) tells
what a merge costs whatever the number of shards.
"""

import os
import shutil

from _iteration import WHOLE as BIN
from _processes import spent
from record import ROOT, record

OUT = ROOT / "out" / "merge64"
SCENE = ROOT / "scenes" / "blocks.glb"
METHODS = os.environ.get("METHODS", "path,vcm").split(",")
SHARDS = int(os.environ.get("SHARDS", "64"))
SIZE = ["--width", os.environ.get("WIDTH", "1280"), "--height", os.environ.get("HEIGHT", "720")]


def shard(method, index):
    """Renders a shard; what that took."""
    command = [BIN, "render", SCENE, "-o", OUT / f"{index}.exr", *SIZE, "--method", method, "--layers", "beauty"]
    command += ["--iterations", 2 * SHARDS, "--shard", f"{index}/{SHARDS}", "--progress", "none", "--no-checkpoint"]
    return spent(command)


def merge(shards, *options):
    """Merges; what that took."""
    return spent([BIN, "merge", *shards, "-o", OUT / "merged.exr", "--layers", "all", *options])


def alone(method):
    """What a shard with all layers takes, and a whole render of as many iterations with its finish."""
    words = [BIN, "render", SCENE, "-o", OUT / "alone.exr", *SIZE, "--method", method, "--progress", "none", "--no-checkpoint"]
    shard = spent([*words, "--iterations", 2 * SHARDS, "--shard", f"0/{SHARDS}"])
    return {"layers": shard, "whole": spent([*words, "--iterations", 2])}


def main():
    for method in METHODS:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        shards = [OUT / f"{index}.exr" for index in range(SHARDS)]
        runs = [shard(method, index) for index in range(SHARDS)]
        middle = sorted(runs, key=lambda run: run["seconds"])[SHARDS // 2]
        values = {"rule": method, "size": [int(SIZE[1]), int(SIZE[3])], "shards": SHARDS, "shard": middle}
        values["shard"]["file_mib"] = round(shards[0].stat().st_size / 2**20, 1)
        values["one"] = merge(shards[:1], "--partial")
        values["all"] = merge(shards)
        values |= alone(method)
        values["picture_mib"] = round((OUT / "merged.exr").stat().st_size / 2**20, 1)
        print(values, flush=True)
        record("merge64", values)
    shutil.rmtree(OUT)


if __name__ == "__main__":
    main()
