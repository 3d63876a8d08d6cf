"""Time and memory of the bundled network on a picture of 1280x720 pixels with five levels, on two threads."""

import statistics

from ..cache import CACHE, create, program, run_timed
from ..commands import command
from ..options import options
from ..processes import measure_process
from ..record import ROOT, record

ARGUMENTS = {"rounds": 3, "threads": 2}
WORDS = {"without a network": [], "with the bundled network": ["--model", "compact"]}


def picture():
    """A rendered picture with all layers that the network reads, from the cache if possible."""
    folder = CACHE / "combiner_cost" / program()
    if not folder.exists():
        with create(folder) as draft:
            settings = {"method": "sppm", "width": 1280, "height": 720, "iterations": 2, "levels": 5, "eye_paths": 2}
            settings |= {"layers": "all", "no_finish": True, "no_checkpoint": True, "progress": "none"}
            run_timed(command("render", ROOT / "scenes" / "interior.glb", "-o", draft / "picture.exr", **settings))
    return folder / "picture.exr"


def main():
    file, runs = picture(), {name: [] for name in WORDS}
    for _ in range(options.rounds):
        for name, words in WORDS.items():
            out = file.with_name("finished.exr")
            line = command("finish", file, "-o", out, denoise="none", threads=options.threads)
            runs[name].append(measure_process([*line, *words]))
    middle = {
        name: {key: statistics.median(one[key] for one in found) for key in found[0]} for name, found in runs.items()
    }
    for name, of in middle.items():
        print(f"{name:26}{of['seconds']:8.2f} s{of['core_seconds']:8.2f} core-s{of['peak_mib']:8.0f} MiB")
    record("combiner_cost", {"program": program(), "rounds": options.rounds, "threads": options.threads, "runs": middle})
