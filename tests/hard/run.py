"""Runs the hard cases, writes the page of results, and fails if a case fails without a known reason."""

import argparse
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from . import families, judge, page, table
from .peer_stage import PEERS, CannotTranslate, PeerStage
from .stage import Broken, Stage, read

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Result:
    """The result of a case with a method. state: met, failed, known (a known failure), passed (although a failure is
    known) or cannot (a peer's driver cannot translate the scene); seconds: total time of the renders."""

    case: object
    method: str
    state: str
    verdict: judge.Verdict
    seconds: float
    commands: list
    pictures: dict


def play(stage):
    """Renders a stage's case by its method, and tests the answer."""
    case, method = stage.case, stage.method
    try:
        verdict = case.answer.judge(stage)
    except CannotTranslate as cannot:
        return Result(case, method, "cannot", judge.Verdict(True, str(cannot)), 0.0, stage.commands, {})
    except Broken as broken:
        verdict = judge.Verdict(False, str(broken)[-400:], float("inf"))
    known = case.fails.get(method)
    state = ("passed" if known else "met") if verdict.passed else ("known" if known else "failed")
    shown = {
        label: read(stage.picture(f"{label}-0"))
        for label in case.answer.shown()
        if stage.picture(f"{label}-0").is_file()
    }
    stage.clear()
    return Result(case, method, state, verdict, stage.seconds, stage.commands, shown)


def select(options):
    """The cases that the command line selects; a name selects all cases that begin with it."""
    known = families.cases()
    if not options.only:
        return [case for case in known if options.long or not case.long]
    for name in options.only:
        if not any(case.name.startswith(name) for case in known):
            sys.exit(f"hard cases: error: no case's name begins with '{name}'\nhint: --list prints them all")
    return [case for case in known if any(case.name.startswith(name) for name in options.only)]


def parser():
    made = argparse.ArgumentParser(prog="tests/hard-cases.sh", description=__doc__)
    made.add_argument("--long", action="store_true", help="also run the long cases")
    made.add_argument("--only", nargs="+", metavar="NAME", help="only cases whose names begin with one of these")
    made.add_argument(
        "--with",
        dest="peers",
        metavar="LIST",
        type=names(PEERS),
        default=[],
        help=f"other renderers, among {', '.join(PEERS)}; scripts/compare/setup.sh peers installs them",
    )
    made.add_argument("--budget", type=float, default=1.0, help="seconds of a peer's picture [default: 1]")
    made.add_argument("--methods", metavar="LIST", type=names(()), help="only these methods, separated by commas")
    made.add_argument("--list", action="store_true", help="only print the names of the cases")
    made.add_argument("--scenes", action="store_true", help="only write the scenes and their answers")
    made.add_argument("--table", action="store_true", help="only write the table of docs/lab/hard-cases.md")
    made.add_argument("--threads", type=int, default=1, help="threads of a render [default: 1]")
    made.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="number of simultaneous renders [default: all cores]"
    )
    made.add_argument("--program", type=Path, default=ROOT / "target/release/caustique", help="the program caustique")
    made.add_argument(
        "-o", "--output", type=Path, default=ROOT / "out/hard", help="folder of the output [default: out/hard]"
    )
    return made


def line(result):
    """A result in one line."""
    return f"{result.state:7} {result.seconds:5.1f} s {result.case.name} {result.method}: {result.verdict.figure}"


def stages_of(case, options):
    """The stages of a case: one for each selected method and peer."""
    folder, threads = options.output, options.threads
    own = [
        Stage(options.program, folder, case, method, threads)
        for method in case.methods
        if options.methods is None or method in options.methods
    ]
    peers = [PeerStage(folder, case, peer, options.budget, threads) for peer in options.peers if case.answer.peers]
    return own + peers


def names(known):
    """A parser of comma-separated names, which must be among `known` if it is not empty."""

    def take(text):
        found = [name for name in text.split(",") if name]
        wrong = [name for name in found if known and name not in known]
        if wrong:
            raise argparse.ArgumentTypeError(f"'{wrong[0]}' is not one of {', '.join(known)}")
        return found

    return take


def main(arguments=None):
    options = parser().parse_args(arguments)
    if options.table:
        table.write()
        return 0
    cases = select(options)
    if options.list:
        print("\n".join(f"{case.name:32} {case.title}" for case in cases))
        return 0
    options.output.mkdir(parents=True, exist_ok=True)
    for case in cases:
        case.write(options.output)
    if options.scenes:
        return 0
    started, results = time.monotonic(), []
    stages = [stage for case in cases for stage in stages_of(case, options)]
    with ThreadPoolExecutor(options.jobs) as pool:
        for result in pool.map(play, stages):
            results.append(result)
            print(line(result), flush=True)
    return finish(results, options.output, time.monotonic() - started)


def finish(results, folder, seconds):
    """Writes the page and results.json, and prints the summary; returns the exit code."""
    (folder / "index.html").write_text(page.page(results))
    (folder / "results.json").write_text(
        json.dumps(
            [
                {
                    "case": r.case.name,
                    "method": r.method,
                    "state": r.state,
                    "figure": r.verdict.figure,
                    "seconds": round(r.seconds, 2),
                }
                for r in results
            ],
            indent=1,
        )
        + "\n"
    )
    own = [r for r in results if r.method not in PEERS]
    counts = {state: sum(r.state == state for r in own) for state in ("met", "known", "failed", "passed")}
    print(f"\n{folder / 'index.html'}")
    for result in own:
        if result.state in ("failed", "passed"):
            print(
                "FAILED "
                + line(result)
                + (
                    " (although it is known to fail: remove the reason from its case)"
                    if result.state == "passed"
                    else ""
                )
            )
    bad = counts["failed"] + counts["passed"]
    print(f"{counts['met']} met, {counts['known']} known to fail, {bad} failed, {seconds:.0f} s")
    return 1 if bad else 0
