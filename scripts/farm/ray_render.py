#!/usr/bin/env python3
"""Renders a picture, or the frames of an animation, on a Ray cluster: one task per shard, and one that merges them.

  .venv-farm/bin/python scripts/farm/ray_render.py SCENE -o OUT.exr --shards N [--frames A-B[,STEP]] [--address A]
                        [--cores C] [options of caustique render] [-- options of caustique merge]

  .venv-farm/bin/python scripts/farm/ray_render.py scenes/pool.glb -o out/pool.exr --shards 16 --iterations 256

`scripts/setup.sh farm` makes .venv-farm. Without --address, this machine is the whole cluster. A shard that fails or
whose worker dies is retried and continues from its checkpoint. Every --partial seconds the finished shards are merged
to a picture so far, out/pool.partial.exr and .png. Frames are submitted as a stream: the queue holds at most twice the
number of shards that can run. A line of output reports each merged picture. All nodes must have access to scene, output
and program. Repeating the command continues from the existing shards. CAUSTIQUE_BIN is the program.
"""

import argparse
import math
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import ray

HERE = Path(__file__).resolve().parent
# Options that the farm sets itself, or that have no meaning for a shard.
RESERVED = ("--shard", "--resume", "--checkpoint", "--threads")
# Options of a merge, because no shard is a picture.
MERGE_OPTIONS = ("--png", "--exposure", "--tonemap", "--contrast", "--preview", "--layers")


class Refused(Exception):
    """A task has a wrong command line: a retry would fail, too."""


class Failed(Exception):
    """A task ended with an error or by a signal."""


def run(words, log):
    """Run a script of this folder, which dies with the worker. Its output goes to the file `log`."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("a", encoding="utf-8") as out:
        done = subprocess.run(["setpriv", "--pdeathsig", "KILL", *map(str, words)], stdout=out, stderr=out, check=False)
    if done.returncode:
        last = " ".join(log.read_text(encoding="utf-8").splitlines()[-2:])
        kind = Refused if done.returncode == 2 else Failed
        raise kind(f"{log}: exit code {done.returncode}: {last}")


# Ray counts the retries, after a worker dies or a render fails.
task = ray.remote(retry_exceptions=[Failed])


@task
def shard(request, picture, index):
    """Render one shard of a picture, a part of its iterations, by a script of this folder."""
    words = [HERE / "shard.sh", request.scene, request.output, f"{index}/{request.shards}", *picture.frame_arguments]
    run([*words, "--threads", request.cores, *request.render], picture.folder / f"{index}.log")


@task
def merge(request, picture):
    """Merge the shards of a picture and remove them."""
    words = [HERE / "merge.sh", request.output, *picture.frame_arguments, "--threads", request.cores, *request.merge]
    run(words, picture.output.with_suffix(".log"))


@task
def partial(picture):
    """Merge the finished shards of an unfinished picture into a preview of it."""
    so_far = picture.partial
    words = [program(), "merge", "--partial", *sorted(picture.folder.glob("shard-*.exr"))]
    run([*words, "-o", so_far, "--png", so_far.with_suffix(".png")], picture.folder / "partial.log")


def program():
    """The path of the program, from names.sh."""
    words = ["bash", "-c", f'. "{HERE / "names.sh"}"; printf %s "$CAUSTIQUE"']
    return subprocess.run(words, stdout=subprocess.PIPE, check=True, text=True).stdout


@dataclass
class Picture:
    """A picture and the number of its shards that are unfinished, finished, and merged into its last preview."""

    output: Path
    frame: int | None
    left: int
    done: int = 0
    shown: int = 0
    showing: object = field(default=None, repr=False)

    @property
    def folder(self):
        """The path of the folder that holds the picture's shards."""
        return self.output.with_suffix(".shards")

    @property
    def partial(self):
        """The path of the EXR file of the picture's last preview."""
        return self.output.with_suffix(".partial.exr")

    @property
    def frame_arguments(self):
        """The arguments that name the frame to the scripts of this folder; empty for a picture without one."""
        return [] if self.frame is None else ["--frame", self.frame]


def numbered(path, frame):
    """The path with the frame's number in place of a run of '#', as in names.sh."""
    return path.with_name(re.sub("#+", lambda run: f"{frame:0{len(run[0])}}", path.name, count=1))


def frames_of(text):
    """Parse a range of frame numbers: A, A-B or A-B,STEP."""
    match = re.fullmatch(r"(\d+)(?:-(\d+))?(?:,([1-9]\d*))?", text)
    if not match or (match[2] and int(match[2]) < int(match[1])):
        raise argparse.ArgumentTypeError(f"{text!r}: give A-B or A-B,STEP, such as 1-100")
    return range(int(match[1]), int(match[2] or match[1]) + 1, int(match[3] or 1))


def pictures(request):
    """Render. Yields each picture when it is merged, and shows pictures so far."""
    frames = [None] if request.frames is None else request.frames
    tasks = shards_in_order(request, frames)
    capacity = math.ceil(2 * ray.cluster_resources().get("CPU", 1) / request.cores)
    running, last_shown = {}, time.monotonic()
    more = True
    while more or running:
        while more and len(running) < capacity:
            ready = next(tasks, None)
            more = ready is not None
            if more:
                running[ready[0]] = ready[1]
        ended, _ = ray.wait(list(running), timeout=1)
        for reference in ended:
            picture = running.pop(reference)
            ray.get(reference)
            if picture.left == 0:
                yield picture
                continue
            picture.left -= 1
            picture.done += 1
            if picture.left == 0:
                running[submit_merge(request, picture)] = picture
        if request.partial and time.monotonic() - last_shown > request.partial:
            last_shown = time.monotonic()
            for picture in {id(of): of for of in running.values()}.values():
                show(picture)


def shards_in_order(request, frames):
    """Submit one shard per iteration. Yields its Ray reference and its picture."""
    for frame in frames:
        output = request.output if frame is None else numbered(request.output, frame)
        picture = Picture(output, frame, request.shards)
        for index in range(request.shards):
            options = {"num_cpus": request.cores, "max_retries": request.retries, "scheduling_strategy": "SPREAD"}
            yield shard.options(**options).remote(request, picture, index), picture


def submit_merge(request, picture):
    """Submit the merge of a picture, after a picture so far no longer reads its shards."""
    if picture.showing is not None:
        ray.wait([picture.showing])
        picture.showing = None
    return merge.options(num_cpus=request.cores, max_retries=request.retries).remote(request, picture)


def show(picture):
    """Submit a picture so far, if there are new shards and none is being made."""
    busy = picture.showing is not None and not ray.wait([picture.showing], timeout=0)[0]
    if picture.left and picture.done > picture.shown and not busy:
        picture.shown = picture.done
        # Without CPUs, so that it starts before waiting shards.
        picture.showing = partial.options(num_cpus=0, max_retries=0, retry_exceptions=False).remote(picture)


@dataclass
class Request:
    """The parsed command line of a farm's render."""

    scene: Path
    output: Path
    shards: int
    frames: range | None
    cores: int
    retries: int
    partial: float
    address: str | None
    render: list
    merge: list


def count(text):
    """Parse a count of 1 or more."""
    if not re.fullmatch(r"[1-9]\d*", text):
        raise argparse.ArgumentTypeError(f"{text!r}: give 1 or more")
    return int(text)


def parse_request(words):
    """Parse the command line."""
    mine, merges = (words[: words.index("--")], words[words.index("--") + 1 :]) if "--" in words else (words, [])
    parser = argparse.ArgumentParser(description="Renders on a Ray cluster.", allow_abbrev=False)
    parser.add_argument("scene", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.exr")
    parser.add_argument("--shards", type=count, required=True, metavar="N")
    parser.add_argument("--frames", type=frames_of, metavar="A-B[,STEP]")
    parser.add_argument("--cores", type=count, default=1, help="cores per task (1)")
    parser.add_argument("--retries", type=int, default=3, help="retries of a failed task (3)")
    parser.add_argument("--partial", type=float, default=60, help="seconds between pictures so far, 0 for none (60)")
    parser.add_argument("--address", help="address of the cluster for ray.init; default: this machine")
    known, render = parser.parse_known_args(mine)
    for option in (word.partition("=")[0] for word in render):
        if option in RESERVED:
            parser.error(f"{option} is given by the farm")
        if option in MERGE_OPTIONS:
            parser.error(f"{option}: no shard is a picture; give what the merge is to do behind --")
    if not known.scene.is_file():
        parser.error(f"{known.scene}: no such scene")
    if known.output.suffix != ".exr":
        parser.error(f"{known.output} is no name of an EXR")
    if known.frames is not None and "#" not in known.output.name:
        parser.error(f"{known.output}: all frames have the same name; put '####' where the frame's number belongs")
    places = {"scene": known.scene.resolve(), "output": known.output.resolve()}
    # A single shard is the picture.
    render += merges if known.shards == 1 else []
    return Request(**{**vars(known), **places}, render=render, merge=merges)


def main():
    request = parse_request(sys.argv[1:])
    os.environ["CAUSTIQUE_BIN"] = str(Path(program()).resolve()) if "/" in program() else program()
    variables = {"CAUSTIQUE_BIN": os.environ["CAUSTIQUE_BIN"]}
    ray.init(request.address, log_to_driver=False, include_dashboard=False, runtime_env={"env_vars": variables})
    request.output.parent.mkdir(parents=True, exist_ok=True)
    try:
        for picture in pictures(request):
            for name in (picture.partial, picture.partial.with_suffix(".png"), picture.output.with_suffix(".log")):
                name.unlink(missing_ok=True)
            print(picture.output, flush=True)
    except (ray.exceptions.RayTaskError, ray.exceptions.WorkerCrashedError) as error:
        cause = getattr(error, "cause", None) or error
        sys.exit(f"ray_render: error: {cause}\nhint: repeat the command to continue from the existing shards")


if __name__ == "__main__":
    main()
