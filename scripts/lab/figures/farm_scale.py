"""Costs of a picture's shards for the model of scale (scripts/farm/scale.py), and measured points beside the model: 1, 2
and 4 workers of one thread on this machine.

The scene is the interior by guided `vcm`, the choice of `auto`. The pilot that compares methods is measured on matte
blocks, where `auto` runs one. Costs are core-seconds of one thread, which other work on the machine changes little; the
least of --rounds counts, also for the seconds of the points.
"""

import json
import os
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import scale

from ..cache import BIN
from ..commands import command, read
from ..options import options as given
from ..processes import measure_process
from ..record import ROOT, record


OUT = ROOT / "out" / "scale"
ARGUMENTS = {"width": 1280, "rounds": 3}
# Shards and iterations of the measured points, and iterations of the picture that the model predicts.
SHARDS, FEW, MANY = 4, 16, 256
TICK = os.sysconf("SC_CLK_TCK")


def render_command(scene, width, file, *options):
    """The command of a render on one thread, as on a farm."""
    words = ["render", ROOT / "scenes" / f"{scene}.glb", "-o", file, *options]
    return command(*words, width=width, threads=1, layers="beauty", progress="json")


def core_seconds(process):
    """Core-seconds of a running process, without its child processes."""
    fields = open(f"/proc/{process}/stat", encoding="utf-8").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def shard(scene, width, *options):
    """Core-seconds of a shard before the first iteration, of an iteration, and after the last, and the size of its file."""
    file = OUT / "shard.exr"
    process = subprocess.Popen(render_command(scene, width, file, *options), stderr=subprocess.PIPE, text=True)
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
    """The model's costs of a picture of this width."""
    of = least(
        [shard("interior", width, "--iterations", 4 * SHARDS, "--shard", f"0/{SHARDS}") for _ in range(given.rounds)]
    )
    files = []
    for index in range(SHARDS):
        files.append(OUT / f"{index}.exr")
        options = ["--iterations", SHARDS, "--shard", f"{index}/{SHARDS}"]
        measure_process(render_command("interior", width, files[-1], *options))
    merge = [BIN, "merge", "-o", OUT / "merged.exr", "--layers", "all", "--threads", 1]
    merges = [*merge, *files], [*merge, files[0], "--partial"]
    rounds = [[measure_process(line) for line in merges] for _ in range(given.rounds)]
    whole, one = (min(run["core_seconds"] for run in runs) for runs in zip(*rounds))
    each = (whole - one) / (SHARDS - 1)
    of |= {"each": each, "finish": one - each}
    return {key: round(value, 4) for key, value in of.items()}


def pilot_costs(width):
    """Core-seconds of auto's pilot for a render of MANY iterations, and of an iteration of the chosen method."""
    of = shard("blocks", width, "--iterations", MANY, "--shard", f"0/{MANY // 2}")
    return {"iterations": MANY, "pilot": round(of["pilot"], 2), "iteration": round(of["iteration"], 3)}


def point(workers, width):
    """Seconds of the picture with a number of one-threaded workers, including the merge, and the cores that other
    processes used meanwhile."""

    def one(index):
        options = ["--iterations", FEW, "--shard", f"{index}/{SHARDS}"]
        subprocess.run(render_command("interior", width, files[index], *options), check=True, stderr=subprocess.DEVNULL)

    files, start = [OUT / f"{index}.exr" for index in range(SHARDS)], time.perf_counter()
    before, own = busy(), os.times()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(one, range(SHARDS)))
    measure_process([BIN, "merge", *files, "-o", OUT / "merged.exr", "--layers", "all", "--threads", 1])
    seconds, now = time.perf_counter() - start, os.times()
    mine = now.children_user + now.children_system - own.children_user - own.children_system
    return {"seconds": round(seconds, 2), "others": round(max(0, busy() - before - mine) / seconds, 2)}


def busy():
    """Core-seconds of all processes of the machine since it started."""
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
        "contest": pilot_costs(given.width // 2),
    }
    print(values, flush=True)
    cores, workers = len(os.sched_getaffinity(0)), (1, 2, 4)
    # The points alternate, because other work on the machine varies.
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
