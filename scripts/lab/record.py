"""Stores a figure in scripts/lab/results.jsonl, with the commit, the date and the machine it was measured on: in
place of what was stored of the same figure before. A figure of a tree with changes that are not committed is of no
commit, and is not stored.

One line is one object:
{"name": .., "values": {..}, "commit": .., "date": .., "machine": {"cpu": .., "cores": .., "memory_gib": .., "system": ..}}
"""

import datetime
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = Path(__file__).resolve().parent / "results.jsonl"
# Values that tell apart figures of one name.
APART = ("scene", "rule", "parameters", "corrected", "set")


def commit():
    """The commit that is checked out, "-dirty" added if files other than the results and the documentation, which figures
    fill, differ from it: tracked ones, and those of `scripts` and `src` that it does not have at all."""
    try:
        head = _git("rev-parse", "HEAD")
        own = [f":!{RESULTS.relative_to(ROOT)}", ":!docs"]
        changed = _git("status", "--porcelain", "--untracked-files=no", "--", ".", *own)
        changed = changed or _git("ls-files", "--others", "--exclude-standard", "--", "scripts", "src")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head + ("-dirty" if changed else "")


def _git(*args):
    return subprocess.run(["git", "-C", ROOT, *args], capture_output=True, text=True, check=True).stdout.strip()


def machine():
    """Processor, usable cores, memory and system."""
    try:
        info = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        cpu = next(line.split(":", 1)[1].strip() for line in info.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        cpu = platform.processor() or platform.machine()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    try:
        system = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        system = platform.system()
    return {"cpu": cpu, "cores": len(os.sched_getaffinity(0)), "memory_gib": round(memory, 1), "system": system}


def same(one, other):
    """Whether two entries are of the same figure."""
    values = [[entry["values"].get(key) for key in APART] for entry in (one, other)]
    return one["name"] == other["name"] and values[0] == values[1]


def entries(file=RESULTS):
    """All that is stored."""
    file = Path(file)
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


def record(name, values, file=RESULTS):
    """Stores one line and returns the object. `values`: a dict of what JSON can say, without NaN."""
    now = datetime.datetime.now(datetime.UTC)
    entry = {
        "name": name,
        "values": values,
        "commit": commit(),
        "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "machine": machine(),
    }
    json.dumps(entry, allow_nan=False)
    if entry["commit"].endswith("-dirty"):
        print(f"record: {name} is not stored: the tree has changes that are not committed", file=sys.stderr)
        return entry
    file = Path(file)
    kept = [other for other in entries(file) if not same(other, entry)] + [entry]
    draft = file.with_suffix(".part")
    draft.write_text("".join(json.dumps(one, allow_nan=False) + "\n" for one in kept), encoding="utf-8")
    draft.replace(file)
    return entry
