"""The command line, the gate and its summary."""

import argparse
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import families
import judge
import page
from stage import Broken, Stage, read

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Result:
    """What became of a case with a method. state: met, failed, known (fails as it is known to) or passed (although it
    is known to fail); seconds: of its renders."""

    case: object
    method: str
    state: str
    verdict: judge.Verdict
    seconds: float
    commands: list
    pictures: dict


#: States that the gate lets through.
GOOD = ("met", "known")


def play(case, method, program, folder, threads):
    """Plays a case with a method."""
    stage = Stage(program, folder, case, method, threads)
    try:
        verdict = case.answer.judge(stage)
    except Broken as broken:
        verdict = judge.Verdict(False, str(broken)[-400:], float("inf"))
    known = case.fails.get(method)
    state = ("passed" if known else "met") if verdict.passed else ("known" if known else "failed")
    shown = {label: read(stage.picture(f"{label}-0")) for label in case.answer.shown()
             if stage.picture(f"{label}-0").is_file()}
    stage.clear()
    return Result(case, method, state, verdict, stage.seconds, stage.commands, shown)


def chosen(options):
    """The cases of the command line; a name takes those that begin with it."""
    known = families.cases()
    if not options.only:
        return [case for case in known if options.long or not case.long]
    for name in options.only:
        if not any(case.name.startswith(name) for case in known):
            sys.exit(f"hard cases: error: no case's name begins with '{name}'\n"
                     f"hint: --list prints them all")
    return [case for case in known if any(case.name.startswith(name) for name in options.only)]


def parser():
    made = argparse.ArgumentParser(prog="scripts/hard-cases.sh", description=__doc__)
    made.add_argument("--long", action="store_true", help="the cases that take long as well")
    made.add_argument("--only", nargs="+", metavar="NAME", help="the cases whose names begin so")
    made.add_argument("--methods", metavar="LIST", help="these methods alone, separated by commas")
    made.add_argument("--list", action="store_true", help="print the names of the cases and end")
    made.add_argument("--scenes", action="store_true", help="write the scenes and their answers, and end")
    made.add_argument("--threads", type=int, default=1, help="of a render [default: 1]")
    made.add_argument("--jobs", type=int, default=os.cpu_count(), help="renders at a time [default: all cores]")
    made.add_argument("--program", type=Path, default=ROOT / "target/release/caustique", help="caustique")
    made.add_argument("-o", "--output", type=Path, default=ROOT / "out/hard", help="folder [default: out/hard]")
    return made


def line(result):
    """A result in one line."""
    return f"{result.state:7} {result.seconds:5.1f} s {result.case.name} {result.method}: {result.verdict.figure}"


def main(arguments=None):
    options = parser().parse_args(arguments)
    cases = chosen(options)
    if options.list:
        print("\n".join(f"{case.name:32} {case.title}" for case in cases))
        return 0
    options.output.mkdir(parents=True, exist_ok=True)
    for case in cases:
        case.write(options.output)
    if options.scenes:
        return 0
    started, results = time.monotonic(), []
    wanted = options.methods.split(",") if options.methods else None
    pairs = [(case, method) for case in cases for method in case.methods if wanted is None or method in wanted]
    where = (options.program, options.output, options.threads)
    with ThreadPoolExecutor(options.jobs) as pool:
        for result in pool.map(lambda pair: play(*pair, *where), pairs):
            results.append(result)
            print(line(result), flush=True)
    return finish(results, options.output, time.monotonic() - started)


def finish(results, folder, seconds):
    """Writes the page and the figures, prints the summary; the exit code."""
    (folder / "index.html").write_text(page.page(results))
    (folder / "results.json").write_text(json.dumps([
        {"case": r.case.name, "method": r.method, "state": r.state, "figure": r.verdict.figure,
         "seconds": round(r.seconds, 2)} for r in results], indent=1) + "\n")
    counts = {state: sum(r.state == state for r in results) for state in ("met", "known", "failed", "passed")}
    print(f"\n{folder / 'index.html'}")
    for result in results:
        if result.state in ("failed", "passed"):
            print("FAILED " + line(result) + (" (although it is known to fail: take the reason out of its case)"
                                              if result.state == "passed" else ""))
    bad = counts["failed"] + counts["passed"]
    print(f"{counts['met']} met, {counts['known']} known to fail, {bad} failed, {seconds:.0f} s")
    return 1 if bad else 0
