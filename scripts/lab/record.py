"""Stores a figure in scripts/lab/results.jsonl, with its commit, date and machine. It replaces the stored figure of the
same name and subject. Figures of a tree with uncommitted changes are not stored, because no commit describes them.

Each line is one object:
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
# Values that distinguish figures of one name.
SUBJECT_KEYS = ("scene", "corrected", "set")


def commit():
    """The checked-out commit, with "-dirty" if tracked files differ from it, or `scripts` or `src` have untracked files.
    The results and the documentation, which figures write, do not count."""
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
    """The machine that runs this: its processor, usable cores, memory and system."""
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
    """Whether two stored measurements have equal names and equal values of `SUBJECT_KEYS`."""
    values = [[entry["values"].get(key) for key in SUBJECT_KEYS] for entry in (one, other)]
    return one["name"] == other["name"] and values[0] == values[1]


def entries(file=RESULTS):
    """All measurements stored in a file of results."""
    file = Path(file)
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


def record(name, values, file=RESULTS):
    """Stores the measurement `values` under `name` and returns its entry. `values` is a dict for JSON, without NaN."""
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
