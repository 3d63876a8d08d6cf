#!/usr/bin/env python3
"""A model of render farms: how long a picture or a shot takes on a number of cores, and where the time goes.

  .venv-farm/bin/python scripts/farm/scale.py --cores 1000 --frames 1 --iterations 256
  .venv-farm/bin/python scripts/farm/scale.py --draw docs/scale.svg

`scripts/lab.sh farm_scale` stores the costs. `predict` is a formula; `simulate` simulates the farm task by task, and
tests compare both. Assumptions: all iterations of a picture cost the same; the cores of a task share all work evenly,
except for loading the scene and writing the shard; and all files pass through one store, one at a time.
"""

import argparse
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "scripts" / "lab" / "results.jsonl"
# The parts of a picture's time, in order.
PARTS = ("start", "load", "pilot", "iterations", "write", "merge", "finish")


@dataclass(frozen=True)
class Costs:
    """Costs of a picture, in core-seconds except for `file`.

    load: loading the scene, on one core. pilot: choosing the method. iteration: one iteration. write: writing a shard's
    file, on one core. each: merging one shard. finish: the rest of a merge. file: bytes of a shard's file.
    """

    load: float
    pilot: float
    iteration: float
    write: float
    each: float
    finish: float
    file: float


@dataclass(frozen=True)
class Farm:
    """A farm: total cores, cores per task (`threads`), bytes per second of the store, seconds to start a task."""

    cores: int
    threads: int = 1
    store: float = 1e9
    start: float = 1.0
    # Number of parallel tasks, if not the number that the cores allow.
    places: int | None = None

    @property
    def workers(self):
        """The number of tasks that the farm runs in parallel."""
        return self.places or max(1, self.cores // self.threads)

    @property
    def slowness(self):
        """Slowdown of a task because its cores are shared with other tasks."""
        return max(1.0, self.workers * self.threads / self.cores)


@dataclass(frozen=True)
class Job:
    """Number of frames, shards per frame, iterations per frame. `fan`: most files per merge, 0 for no limit."""

    frames: int
    shards: int
    iterations: int
    fan: int = 0


def shard_parts(costs, farm, job, iterations):
    """Seconds of a shard by part, without its transfer."""
    slow = farm.slowness
    return {
        "start": farm.start,
        "load": slow * costs.load,
        "pilot": slow * costs.pilot / farm.threads,
        "iterations": slow * iterations * costs.iteration / farm.threads,
        "write": slow * costs.write,
    }


def merge_parts(costs, farm, job):
    """Seconds of a merge by part, from the last shard to the picture.

    In a tree each merge reads `fan` files and writes one of equal size; all merges of a level run in parallel.
    """
    transfer = costs.file / farm.store
    if not job.fan or job.fan >= job.shards:
        levels, files, between = 1, job.shards, 0.0
    else:
        levels = math.ceil(math.log(job.shards, job.fan) - 1e-9)
        files = levels * job.fan
        between = (levels - 1) * (costs.write + transfer)
    # The other merges of the level also use the store.
    queue = 0 if levels == 1 else (job.shards - job.fan) * transfer
    return {
        "start": levels * farm.start,
        "merge": files * (costs.each / farm.threads + transfer) + between + queue,
        "finish": costs.finish / farm.threads,
    }


def predict(costs, farm, job):
    """Seconds of a job by part: of its one picture, or of all its frames in proportion.

    If there are more tasks than can run in parallel, they run in rounds, or fill the places evenly with merges between
    them. The store's throughput is a lower bound for both.
    """
    shard = shard_parts(costs, farm, job, math.ceil(job.iterations / job.shards))
    merge = merge_parts(costs, farm, job)
    transfer = costs.file / farm.store
    tasks = job.frames * job.shards
    one, last = sum(shard.values()), sum(merge.values())
    rounds = math.ceil(tasks / farm.workers)
    # Files that are ready at the same time pass the store one at a time.
    queue = min(tasks, farm.workers) * transfer
    mean = sum(shard_parts(costs, farm, job, job.iterations / job.shards).values()) + transfer
    busy = (tasks * mean + (job.frames - 1) * last) / farm.workers
    # Merges of pictures whose shards end at the same time also queue.
    together = (min(tasks, max(job.shards, farm.workers)) - job.shards) * transfer
    total = max(rounds * one + queue, busy, one + (2 * tasks - job.shards) * transfer - together) + together + last
    parts = dict.fromkeys(PARTS, 0.0)
    for name, seconds in shard.items():
        parts[name] += rounds * seconds
    parts["write"] += queue
    parts["merge"] += together
    for name, seconds in merge.items():
        parts[name] += seconds * max(1, job.frames / farm.workers)
    scale = total / sum(parts.values())
    return {name: scale * seconds for name, seconds in parts.items()}


def seconds(costs, farm, job):
    """Predicted seconds of a job."""
    return sum(predict(costs, farm, job).values())


def simulate(costs, farm, job):
    """Simulated seconds of a job, task by task.

    Shards wait for places, in the order of frames and after merges; files wait for the store.
    """
    import simpy

    world = simpy.Environment()
    places = simpy.PriorityResource(world, farm.workers)
    store = simpy.Resource(world, 1)
    transfer = costs.file / farm.store

    def pass_store(files):
        for _ in range(files):
            with store.request() as turn:
                yield turn
                yield world.timeout(transfer)

    def shard(frame, index):
        iterations = len(range(index, job.iterations, job.shards))
        with places.request(priority=1 + frame) as place:
            yield place
            yield world.timeout(sum(shard_parts(costs, farm, job, iterations).values()))
            yield from pass_store(1)

    def merge(files, last):
        with places.request(priority=0) as place:
            yield place
            yield world.timeout(farm.start)
            yield from pass_store(files)
            work = files * costs.each + (costs.finish if last else 0.0)
            yield world.timeout(work / farm.threads + (0.0 if last else costs.write))
            if not last:
                yield from pass_store(1)

    def picture(frame):
        yield world.all_of([world.process(shard(frame, index)) for index in range(job.shards)])
        files = job.shards
        while job.fan and files > job.fan:
            groups = [min(job.fan, files - first) for first in range(0, files, job.fan)]
            yield world.all_of([world.process(merge(group, False)) for group in groups])
            files = len(groups)
        yield world.process(merge(files, True))

    for frame in range(job.frames):
        world.process(picture(frame))
    world.run()
    return world.now


def powers(most):
    """The powers of two below `most`, and `most` itself, as numbers to try."""
    return sorted({2**i for i in range(most.bit_length()) if 2**i <= most} | {most})


def best(costs, cores, frames, iterations, widest=64, **farm):
    """The farm and job with the least time: cores per task (at most `widest`) and shards per picture."""
    choices = []
    for threads in powers(min(cores, widest)):
        of = Farm(cores, threads, **farm)
        for shards in powers(min(iterations, max(1, 2 * of.workers))):
            job = Job(frames, shards, iterations)
            choices.append((seconds(costs, of, job), threads, shards, of, job))
    return min(choices, key=lambda choice: choice[:3])[3:]


def stored(name="scale"):
    """The figures that `scripts/lab.sh` stored under a name."""
    rows = [json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines()]
    return [row["values"] for row in rows if row["name"] == name][-1]


def costs_of(values):
    """`Costs` from a stored figure."""
    return Costs(**{name: values[name] for name in Costs.__dataclass_fields__})


def report(costs, cores, frames, iterations, fan=0):
    """Text: the best choice, its time, and the shares of the parts."""
    farm, job = best(costs, cores, frames, iterations)
    job = replace(job, fan=fan)
    parts = predict(costs, farm, job)
    total = sum(parts.values())
    ideal = frames * iterations * costs.iteration / cores
    lines = [
        f"{cores} cores, {frames} frames of {iterations} iterations: {total:.0f} s, "
        f"{100 * ideal / total:.0f} % in iterations",
        f"  {farm.threads} cores per task, {job.shards} shards per picture, {farm.workers} parallel tasks",
        "  " + ", ".join(f"{name} {100 * value / total:.0f} %" for name, value in parts.items()),
    ]
    return "\n".join(lines)


def draw(path, values):
    """Plot measured and modelled seconds against cores, and the parts of a picture's time."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": "scale", "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot

    figure, (left, middle, right) = pyplot.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    points = values["points"]
    left.plot([of["workers"] for of in points], [of["predicted"] for of in points], "-", label="model")
    left.plot([of["workers"] for of in points], [of["seconds"] for of in points], "o", label="measured")
    left.set(
        title="320 x 180, this machine",
        xlabel="workers of one core",
        ylabel="seconds",
        xticks=[1, 2, 4],
        ylim=(0, None),
    )
    costs, iterations = costs_of(values["large"]), values["iterations"]
    many = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 10000]
    for frames, label in ((1, "one picture"), (1000, "1,000 frames")):
        chosen = [best(costs, cores, frames, iterations) for cores in many]
        line = middle.loglog(many, [seconds(costs, *one) for one in chosen], "-", label=label)[0]
        some = [(cores, *one) for cores, one in zip(many, chosen) if frames == 1 or one[1].shards * frames <= 16000]
        middle.loglog(
            [one[0] for one in some], [simulate(costs, *one[1:]) for one in some], "o", color=line.get_color(), ms=4
        )
        work = frames * iterations * costs.iteration
        middle.loglog(many, [work / cores for cores in many], ":", color=line.get_color())
    middle.set(title="1280 x 720; dots: simulated, dotted: ideal", xlabel="cores", ylabel="seconds")
    shares = [predict(costs, *best(costs, cores, 1, iterations)) for cores in many]
    stacked = [[100 * of[name] / sum(of.values()) for of in shares] for name in PARTS]
    right.stackplot(many, stacked, labels=PARTS)
    right.set(title="one picture: where the time goes", xlabel="cores", ylabel="%", xscale="log", ylim=(0, 100))
    for axes in (left, middle):
        axes.legend(frameon=False)
    right.legend(loc="lower left", fontsize=8)
    figure.savefig(path, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description="How long a job takes on a farm, and what to choose.")
    parser.add_argument("--cores", type=int, nargs="+", default=[1, 4, 16, 64, 256, 1000, 4000, 10000])
    parser.add_argument("--frames", type=int, default=1)
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--pilot", type=float, help="core-seconds of the pilot, instead of the measured value")
    parser.add_argument("--fan", type=int, default=0, help="most files per merge, for a hypothetical tree of merges")
    parser.add_argument("--draw", type=Path, metavar="FILE.svg")
    arguments = parser.parse_args()
    values = stored()
    costs = costs_of(values["large"])
    if arguments.pilot is not None:
        costs = replace(costs, pilot=arguments.pilot)
    if arguments.draw:
        draw(arguments.draw, values)
        return
    for cores in arguments.cores:
        print(report(costs, cores, arguments.frames, arguments.iterations or values["iterations"], arguments.fan))


if __name__ == "__main__":
    main()
