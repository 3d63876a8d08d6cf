"""Costs of a picture's shards for the model of scale (scripts/farm/scale.py), and its points: 1, 2 and 4 workers of one
thread on this machine beside what the model says of them.

The interior by guided `vcm`, which `auto` takes there; the contest of methods is measured on matte blocks, where `auto`
has one. Costs are core-seconds of one thread, which other work on the machine changes little: the least of --rounds.
Seconds of the points are the least of as many rounds, too.
"""

import json
import os
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import scale

from ..cache import BIN
from ..options import options as given
from ..reading import read
from ..processes import spent
from ..record import ROOT, record


OUT = ROOT / "out" / "scale"
ARGUMENTS = {"width": 1280, "rounds": 3}
# Shards of the points, iterations of their picture, and those of the picture that the model tells of.
SHARDS, FEW, MANY = 4, 16, 256
TICK = os.sysconf("SC_CLK_TCK")


def command(scene, width, file, *options):
    """A render on one thread, as farms have it."""
    words = [BIN, "render", ROOT / "scenes" / f"{scene}.glb", "-o", file, "--width", width, "--threads", 1]
    return list(map(str, [*words, "--layers", "beauty", "--progress", "json", *options]))


def core_seconds(process):
    """What a process has spent, but for what it started."""
    fields = open(f"/proc/{process}/stat", encoding="utf-8").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def shard(scene, width, *options):
    """Core-seconds of a shard: before the first iteration, of an iteration, and after the last; bytes of its file."""
    file = OUT / "shard.exr"
    process = subprocess.Popen(command(scene, width, file, *options), stderr=subprocess.PIPE, text=True)
    at = [
        core_seconds(process.pid)
        for line in process.stderr
        if line.startswith('{"') and "iteration" in json.loads(line)
    ]
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, f"{scene}: exit code {process.returncode}"
    iteration = (at[-1] - at[0]) / (len(at) - 1)
    whole = usage.ru_utime + usage.ru_stime
    pilot = read("info", file)["phases"]["pilot"]
    return {
        "load": at[0] - iteration - pilot,
        "pilot": pilot,
        "iteration": iteration,
        "write": whole - at[-1],
        "file": file.stat().st_size,
    }


def least(runs):
    """The least of each value."""
    return {key: min(run[key] for run in runs) for key in runs[0]}


def costs(width):
    """Costs of a picture so wide."""
    of = least(
        [shard("interior", width, "--iterations", 4 * SHARDS, "--shard", f"0/{SHARDS}") for _ in range(given.rounds)]
    )
    files = []
    for index in range(SHARDS):
        files.append(OUT / f"{index}.exr")
        spent(command("interior", width, files[-1], "--iterations", SHARDS, "--shard", f"{index}/{SHARDS}"))
    merge = [BIN, "merge", "-o", OUT / "merged.exr", "--layers", "all", "--threads", 1]
    rounds = [[spent([*merge, *files]), spent([*merge, files[0], "--partial"])] for _ in range(given.rounds)]
    whole, one = (min(run["core_seconds"] for run in runs) for runs in zip(*rounds))
    each = (whole - one) / (SHARDS - 1)
    of |= {"each": each, "finish": one - each}
    return {key: round(value, 4) for key, value in of.items()}


def contest(width):
    """Core-seconds of the contest of methods for a render of MANY iterations, and of one iteration of what it chose."""
    of = shard("blocks", width, "--iterations", MANY, "--shard", f"0/{MANY // 2}")
    return {"iterations": MANY, "pilot": round(of["pilot"], 2), "iteration": round(of["iteration"], 3)}


def point(workers, width):
    """Seconds of the picture by so many workers of one thread, the merge included, and cores that others had meanwhile."""

    def one(index):
        options = ["--iterations", FEW, "--shard", f"{index}/{SHARDS}"]
        subprocess.run(command("interior", width, files[index], *options), check=True, stderr=subprocess.DEVNULL)

    files, start = [OUT / f"{index}.exr" for index in range(SHARDS)], time.perf_counter()
    before, own = busy(), os.times()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(one, range(SHARDS)))
    spent([BIN, "merge", *files, "-o", OUT / "merged.exr", "--layers", "all", "--threads", 1])
    seconds, now = time.perf_counter() - start, os.times()
    mine = now.children_user + now.children_system - own.children_user - own.children_system
    return {"seconds": round(seconds, 2), "others": round(max(0, busy() - before - mine) / seconds, 2)}


def busy():
    """Core-seconds that all processes of the machine have spent."""
    with open("/proc/stat", encoding="utf-8") as file:
        user, nice, system, *_ = map(int, file.readline().split()[1:])
    return (user + nice + system) / TICK


def main():
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    small = given.width // 4
    values = {
        "width": given.width,
        "iterations": MANY,
        "small": costs(small),
        "large": costs(given.width),
        "contest": contest(given.width // 2),
    }
    print(values, flush=True)
    cores, workers = len(os.sched_getaffinity(0)), (1, 2, 4)
    # What else the machine does comes and goes: rounds take turns.
    rounds = [[point(count, small) for count in workers] for _ in range(given.rounds)]
    values["points"] = []
    for count, runs in zip(workers, zip(*rounds)):
        farm = scale.Farm(cores, start=0.0, places=count)
        predicted = scale.seconds(scale.costs_of(values["small"]), farm, scale.Job(1, SHARDS, FEW))
        fastest = min(runs, key=lambda run: run["seconds"])
        values["points"].append({"workers": count, **fastest, "predicted": round(predicted, 2)})
    print(values["points"], flush=True)
    shutil.rmtree(OUT)
    record("scale", values)
