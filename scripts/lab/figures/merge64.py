"""Seconds and peak memory of merging 64 shards of two iterations each, and of rendering one shard.

The scene is matte blocks at 1280 x 720, by `path` and by `vcm`. Shards are rendered with `--layers beauty`, as on a
farm; the merge writes all layers. A merge of a single shard (--partial) gives the cost that does not depend on the number
of shards.
"""

import shutil

from ..commands import command
from ..options import options as given
from ..processes import measure_process
from ..record import ROOT, record

OUT = ROOT / "out" / "merge64"
SCENE = ROOT / "scenes" / "blocks.glb"
ARGUMENTS = {"methods": ["path", "vcm"], "shards": 64, "width": 1280, "height": 720}


def render(file, method, iterations, **options):
    """Renders; returns the seconds, core-seconds and peak memory."""
    settings = {"width": given.width, "height": given.height, "method": method, "iterations": iterations}
    words = ["render", SCENE, "-o", OUT / file]
    return measure_process(command(*words, **settings, **options, progress="none", no_checkpoint=True))


def shard(method, index, **options):
    """Renders a shard of two iterations; returns its costs."""
    return render(f"{index}.exr", method, 2 * given.shards, shard=f"{index}/{given.shards}", **options)


def merge(shards, *options):
    """Merges shards; returns the costs."""
    return measure_process(command("merge", *shards, "-o", OUT / "merged.exr", *options, layers="all"))


def alone(method):
    """The costs of a shard with all layers, and of a whole render of two iterations with its finish."""
    return {"layers": shard(method, 0), "whole": render("whole.exr", method, 2)}


def main():
    for method in given.methods:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        shards = [OUT / f"{index}.exr" for index in range(given.shards)]
        runs = [shard(method, index, layers="beauty") for index in range(given.shards)]
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
