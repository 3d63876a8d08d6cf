#!/usr/bin/env python3
"""Fuzzes the USD converter: mutates stages of the tests, and converts each in a separate process.

    .venv-usd/bin/python tests/python/fuzz_usd.py SECONDS [--seed N]
    .venv-usd/bin/python tests/python/fuzz_usd.py --replay STAGE...     converts stages and prints the outcomes

`scripts/setup.sh usd` makes .venv-usd. The first run saves all stages of tests/python/usd_*.py and their files in
~/.cache/caustique-fuzz/seeds/usd (or below $XDG_CACHE_HOME). A stage may convert, raise `faults.Fault`, or raise an
error of USD. All other outcomes are findings, printed once per last line in scripts/usd: other exceptions, more than 20
s, more than 2 GiB. Each finding is saved in faults/usd beside the seeds, to be replayed, and makes the exit code 1.
Stages that make USD itself crash or exceed a limit are saved there and counted separately. Equal seeds give equal
stages.
"""

import argparse
import faulthandler
import hashlib
import importlib
import linecache
import os
import random
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
import unittest
from pathlib import Path

os.environ["PXR_WORK_THREAD_LIMIT"] = "1"  # threads do not outlive a fork

import support  # finds scripts/usd
from pxr import Sdf, Tf, UsdUtils

import convert
import usd_support
from faults import Fault, text_of

ROOT = support.ROOT
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "caustique-fuzz"
SEEDS, FAULTS = CACHE / "seeds" / "usd", CACHE / "faults" / "usd"
# Loaded once for all children.
importlib.import_module("scene")

FINE, OF_USD = ("converted", "refused"), "in USD"
LONGEST, MOST_KIB = 20, 2 << 20
NUMBERS = ("nan", "inf", "-inf", "-1", "0", "1", "1e38", "-1e38", "1e-38", "0.5", "2147483647", "2147483648", "7")
TYPES = ("float", "double", "half", "int", "bool", "string", "token", "asset", "color3f", "float2", "float3", "float4",
         "int2", "matrix4d", "quatf", "timecode", "rel", "int64", "uchar", "float[]", "int[]", "color3f[]", "token[]")
# Values that go with their types.
TYPED = (("float", "nan"), ("double", "1e308"), ("int", "-1"), ("int", "0"), ("bool", "1"), ("string", '"a"'),
         ("token", '""'), ("asset", "@./@"), ("color3f", "(inf, 0, 0)"), ("color4f", "(1, 2, 3, 4)"),
         ("float2", "(0, -1)"), ("quatf", "(1, 0, 0, 0)"), ("timecode", "1"), ("float[]", "[]"), ("float[]", "[nan]"),
         ("int[]", "[0, -1, 9]"), ("color3f[]", "[(1e38, 0, nan)]"), ("string[]", '["a"]'), ("float", "None"),
         ("matrix4d", "((0, 0, 0, 0), (0, 0, 0, 0), (0, 0, 0, 0), (0, 0, 0, 0))"), ("double[]", "[1e308, 1e308]"))
VALUE = re.compile(r"^((?:\s|custom |uniform )*)[\w\[\]]+ ([\w:]+) = [^\[(]*(\(.*\)|\[.*\])?$", re.M)
TOKEN = re.compile(r'"[^"\n]*"|@[^@\n]*@|<[^>\n]*>|[\w.:+-]+|[^\w\s]')
NUMBER = re.compile(r"-?[\d.]+(e[+-]?\d+)?$")


def keep_seeds():
    """Run the tests without rendering, and save their stages."""
    def keep(path):
        folder = SEEDS / hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]
        if not folder.exists():
            shutil.copytree(Path(path).parent, folder, ignore=shutil.ignore_patterns("*.glb", "out.exr"))
            (folder / Path(path).name).replace(folder / "stage.usda")

    def converted(case, path=None, **options):
        case.stage.GetRootLayer().Save()
        keep(path or case.path)
        return original(case, path, **options)

    def run(args, **_):
        for path in args:
            if str(path).endswith(".usda") and Path(path).is_file():
                keep(path)
        raise unittest.SkipTest("no rendering")

    original, usd_support.Stages.convert, support.run = usd_support.Stages.convert, converted, run
    unittest.TextTestRunner().run(unittest.defaultTestLoader.discover(ROOT / "tests" / "python", "usd_*.py"))


def mutated(text, others, rng):
    """Mutate a USD text, also with lines of other stages."""
    for _ in range(rng.choice((1, 1, 1, 1, 2, 3))):
        lines, tokens = text.split("\n"), list(TOKEN.finditer(text))
        values = list(VALUE.finditer(text))
        if values and rng.random() < 0.3:
            at, (type_, value) = rng.choice(values), rng.choice(TYPED)
            text = f"{text[:at.start()]}{at[1]}{type_} {at[2]} = {value}{text[at.end():]}"
            continue
        if not tokens or rng.random() < 0.3:
            # Mostly lines without brackets, because more of the results are valid USD.
            flat = [k for k, line in enumerate(lines) if "=" in line] if rng.random() < 0.9 else range(len(lines))
            a, b = (rng.choice(flat or [0]) for _ in range(2))
            other = rng.choice([line for line in rng.choice(others).split("\n") if "=" in line] or [""])
            change = rng.choice(((a, []), (b, [lines[a], lines[b]]), (b, [other, lines[b]]), (b, [other]),
                                 (b, [lines[b]] * 40)))
            lines[change[0]:change[0] + 1] = change[1]
            text = "\n".join(lines)
            continue
        numbers, types = [t for t in tokens if NUMBER.match(t[0])], [t for t in tokens if t[0] in TYPES]
        paths, texts = [t for t in tokens if t[0][0] == "<"], [t for t in tokens if t[0][0] in '"@']
        chosen = rng.choice([c for c in (numbers, numbers, types, paths, texts, tokens) if c])
        at, new = rng.choice(chosen), rng.choice(chosen)[0]
        if chosen is numbers and rng.random() < 0.8:
            whole = at[0].isdigit() and rng.random() < 0.7
            new = rng.choice([number for number in NUMBERS if not whole or number.lstrip("-").isdigit()])
        elif chosen is types:
            new = rng.choice(TYPES)
        elif chosen is tokens:
            new = rng.choice((new, "", at[0] * 2, rng.choice(NUMBERS), "None", "[]", '""'))
        text = text[:at.start()] + new + text[at.end():]
    return text


def flipped(data, rng):
    """Change some bytes, and sometimes truncate them."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16)) if data else 0):
        at = rng.randrange(len(data))
        data[at] = rng.choice((data[at] ^ 1 << rng.randrange(8), 0, 255, rng.randrange(256)))
    return bytes(data[:rng.randrange(len(data) + 1)] if rng.random() < 0.05 else data)


def child(task, *args):
    """Run a task in a child process. Returns its signal or 0; "hang", "memory" or None; and its output."""
    reads, writes = os.pipe()
    pid = os.fork()
    if not pid:
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1), os.dup2(null, 2)
        faulthandler.enable(writes)
        try:
            task(*args)
        except (Fault, Tf.ErrorException) as fine:
            os.write(writes, f"refused: {text_of(fine)}".encode(errors="replace")[:4096])
        except BaseException:
            os.write(writes, traceback.format_exc().encode(errors="replace")[-32768:])
        os._exit(0)
    os.close(writes)
    said, part, trouble, end = b"", b"", None, time.monotonic() + LONGEST
    while part is not None:
        if not select.select([reads], [], [], max(0, end - time.monotonic()))[0]:
            os.kill(pid, signal.SIGKILL if trouble else signal.SIGABRT)  # SIGABRT first, which prints a traceback
            trouble, end = "hang", time.monotonic() + 2
            continue
        part = os.read(reads, 65536) or None
        said += part or b""
    os.close(reads)
    _, status, usage = os.wait4(pid, 0)
    trouble = trouble or ("memory" if usage.ru_maxrss > MOST_KIB else None)
    return os.WTERMSIG(status), trouble, said.decode(errors="replace")


def converts(path, out, frame):
    """Convert a stage and read its arguments."""
    try:
        convert.write(path, out, frame)
    finally:
        convert.arguments(path)


def verdict(path, frame=None):
    """Convert a stage. Returns the outcome (in `FINE`, `OF_USD`, or a kind of finding), its place in scripts/usd, and
    text."""
    with tempfile.TemporaryDirectory() as out:
        ended, trouble, said = child(converts, str(path), out + "/out.glb", frame)
    frames = re.findall(r'File "([^"]*/scripts/usd/(\w+)\.py)", line (\d+)', said) or [("", "somewhere", "0")]
    file, name, line = frames[0 if ended else -1]
    reading = said.startswith("refused: : USD cannot read") or "Stage.Open(" in linecache.getline(file, int(line))
    if ended and not trouble or trouble and reading or "std::bad_alloc" in said:
        return OF_USD, trouble or "std::bad_alloc" in said and "memory" or f"signal {ended} {name} {line}", said
    if trouble or said and not said.startswith("refused: "):
        return trouble or said.strip().splitlines()[-1].split(":")[0].split(".")[-1], f"{name} {line}", said
    return FINE[bool(said)], "", said


def package(path, base):
    """Write a stage as .usdc and .usdz, too."""
    Sdf.Layer.FindOrOpen(str(path)).Export(f"{base}.usdc")
    UsdUtils.CreateNewUsdzPackage(str(path), f"{base}.usdz")


def fuzz(seconds, seed, scratch):
    """Convert mutated stages for `seconds`, and print the counts of outcomes. Returns whether there are findings."""
    seeds = sorted(SEEDS.iterdir())
    texts = [(folder / "stage.usda").read_text(errors="replace") for folder in seeds]
    rng, found, counts, end = random.Random(seed), set(), {}, time.monotonic() + seconds
    while time.monotonic() < end:
        at = rng.randrange(len(seeds))
        work, suffix = scratch / seeds[at].name, rng.choice(("usda",) * 8 + ("usdc", "usdz"))
        if not work.exists():
            shutil.copytree(seeds[at], work)
            child(package, work / "stage.usda", work / "whole")
        path, whole = work / f"mutated.{suffix}", work / f"whole.{suffix}"
        data = mutated(texts[at], texts, rng).encode() if suffix == "usda" else b""
        if suffix != "usda" or rng.random() < 0.03:
            data = flipped(data or (whole.read_bytes() if whole.exists() else b""), rng)
        path.write_bytes(data)
        kind, where, said = verdict(path, rng.choice((None, None, None, 0.0, 2.0)))
        counts[kind] = counts.get(kind, 0) + 1
        name = f"{kind} {where} {suffix if kind == OF_USD else ''}".strip().replace(" ", "-")
        if kind not in FINE and name not in found:
            found.add(name)
            shutil.rmtree(FAULTS / name, ignore_errors=True)
            shutil.copytree(work, FAULTS / name, ignore=shutil.ignore_patterns("whole.*", "stage.usda"))
            (FAULTS / name / "said.txt").write_text(said)
            print(f"{FAULTS / name}: {(said.strip().splitlines() or [kind])[-1]}", flush=True)
        path.unlink()
    print(f"{sum(counts.values())} stages:", ", ".join(f"{count} {kind}" for kind, count in counts.items()))
    return bool(counts.keys() - {*FINE, OF_USD})


def main():
    """Run the command line. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seconds", type=float, nargs="?", default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--replay", nargs="+", metavar="STAGE", default=[])
    given = parser.parse_args()
    os.nice(19)
    verdicts = [verdict(Path(path).resolve()) for path in given.replay]
    for path, said in zip(given.replay, verdicts):
        print(f"{path}:", *said)
    if verdicts:
        return int(any(kind not in (*FINE, OF_USD) for kind, _, _ in verdicts))
    FAULTS.mkdir(parents=True, exist_ok=True)
    if not SEEDS.exists():
        pid = os.fork()
        if not pid:
            keep_seeds()
            os._exit(0)
        os.waitpid(pid, 0)
    with tempfile.TemporaryDirectory(prefix="caustique-") as scratch:
        return int(fuzz(given.seconds, given.seed, Path(scratch)))


if __name__ == "__main__":
    sys.exit(main())
