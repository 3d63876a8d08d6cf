"""Trains the networks of the combiner or, with --finish, that of the finish, in turns, at the lowest priority, and stores
their errors on held-out views. A repeated run continues where the last one stopped, also on another machine. On a machine
with a GPU and many cores, --together trains all at once, and --seconds ends their schedules after a time.

It needs views of scripts/lab.sh training_data; those that are finished later join. The run `paper` is the paper's
network with its loss, the others compare inputs and pairs of pictures with the compact network
(scripts/lab/train/README.md).
"""

import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from ..cache import installed
from ..options import names, options
from ..record import record
from ..train import finish_views, views
from .training_data import FINISH_FOLDER, FOLDER

# Options of each run. All but `paper`, whose steps take forty times as long, have the same number of steps.
STEPS = ["--steps", 16_000]
WIDE = ["--wide", "--side", 96, *STEPS]
RUNS = {
    "compact": ["--pairs", "multi", "--version", 2, *STEPS],
    "wide": ["--pairs", "multi", "--version", 2, *WIDE],
    "wide-one-path": ["--pairs", "multi", "--version", 2, "--paths", 1, *WIDE],
    "finished": ["--pairs", "finished", "--paths", 1, *WIDE],
    "levels-only": ["--pairs", "multi", *STEPS],
    "paper": ["--arch", "paper", "--methods", "sppm", "--squared", 0, "--rate", 1e-4, "--steps", 1_600],
    **{f"dual{n}": ["--pairs", f"dual{n}", "--version", 2, *STEPS] for n in (2, 3, 4, 5)},
    "deep-single": ["--pairs", "deep-single", "--methods", "sppm", "--paths", 1, *STEPS],
    "deep-multi": ["--pairs", "deep-multi", "--methods", "sppm", "--paths", 1, *STEPS],
}
# The run of the network of the finish.
FINISH_RUNS = {"finish": ["--side", 96, "--batch", 8, "--rate", 1e-3, "--steps", 100_000]}
UNLIMITED = 10**9
# Minutes of a run before it is the next one's turn.
TURN = 20.0


def add_arguments(parser):
    parser.add_argument("--finish", action="store_true", help="train the network of the finish")
    parser.add_argument(
        "--folder", type=Path, help=f"folder of data and runs [default: {FOLDER}; with --finish {FINISH_FOLDER}]"
    )
    parser.add_argument("--hours", type=float, default=10.0, help="hours of this call [default: 10]")
    parser.add_argument("--runs", type=names, help=f"runs to train [default: {','.join(RUNS)}; with --finish finish]")
    parser.add_argument("--threads", type=int, default=1, help="threads [default: 1]")
    parser.add_argument("--together", action="store_true", help="train all runs at the same time")
    parser.add_argument("--seconds", type=float, help="seconds of a run, in place of its steps")


def known_runs():
    """The options of the runs that this call can train, by name."""
    return FINISH_RUNS if options.finish else RUNS


def last_line(run):
    """The last line of a run's curves, or None."""
    log = options.folder / "runs" / run / "log.jsonl"
    return json.loads(log.read_text(encoding="utf-8").splitlines()[-1]) if log.exists() else None


def steps(run):
    """The number of steps of a whole run."""
    words = known_runs()[run]
    return words[words.index("--steps") + 1]


def trainable(run):
    """Whether a run is not finished, and the data have what it needs."""
    line = last_line(run)
    if line and (line["seconds"] >= options.seconds if options.seconds else line["step"] >= steps(run)):
        return False
    if options.finish:
        return bool(finish_views.files(options.folder, False))
    paths, pairs = 1 if "--paths" in RUNS[run] else 2, run if run.startswith("deep") else "multi"
    return bool(views.files(options.folder, False, ["sppm"], [paths], pairs))


def start(run, minutes):
    """Starts to train a run for at most some minutes."""
    words = ["--data", options.folder, "--out", options.folder / "runs" / run, "--threads", options.threads]
    words += ["--minutes", f"{minutes:.1f}", *known_runs()[run]]
    if options.seconds:
        words += ["--seconds", options.seconds, "--steps", UNLIMITED]
    module = "lab.train.finish_train" if options.finish else "lab.train.train"
    line = [installed(".venv-train") or sys.executable, "-m", module, *words]
    return subprocess.Popen(list(map(str, line)))


def main():
    os.nice(19)
    if not installed(".venv-train") and not importlib.util.find_spec("torch"):
        raise SystemExit("training needs PyTorch; scripts/setup.sh train installs it")
    options.folder = options.folder or (FINISH_FOLDER if options.finish else FOLDER)
    options.runs = options.runs or list(known_runs())
    unknown = [run for run in options.runs if run not in known_runs()]
    if unknown:
        raise SystemExit(f"--runs {unknown[0]} is not one of {', '.join(known_runs())}")
    end, failed = time.monotonic() + 3600 * options.hours, set()
    while time.monotonic() < end:
        runs = [run for run in options.runs if run not in failed and trainable(run)]
        if not runs:
            break
        for group in [runs] if options.together else [[run] for run in runs]:
            left = (end - time.monotonic()) / 60
            minutes = max(left if options.together else min(TURN, left), 0.1)
            started = {run: start(run, minutes) for run in group}
            failed |= {run for run, process in started.items() if process.wait() != 0}
    for run in options.runs:
        print(f"{run:14}{'failed; ' if run in failed else ''}{json.dumps(last_line(run))}")
    lines = {run: last_line(run) for run in options.runs if last_line(run)}
    files = finish_views.files if options.finish else views.files
    stacks = {held_out: len({item[0] for item in files(options.folder, held_out)}) for held_out in (False, True)}
    record(
        "training_finish" if options.finish else "training",
        {"views": stacks[False], "held_out_views": stacks[True], "runs": lines},
    )
    return 1 if failed else 0
