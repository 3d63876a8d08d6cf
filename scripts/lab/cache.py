"""Where the figures of finished pictures keep what took long: a later run, or one that goes on, finds it again.

A work is a folder of its own. It is made under another name and renamed when all of it is there, so that what is there
is whole.
"""

import contextlib
import hashlib
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

from .record import ROOT

HOME = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
CACHE = Path(os.environ.get("CAUSTIQUE_CACHE", HOME / "caustique" / "finished"))
BIN = Path(os.environ.get("CAUSTIQUE_BIN", ROOT / "target/release/caustique")).resolve()


def installed(venv):
    """The Python of an environment that scripts make, or nothing."""
    python = ROOT / venv / "bin" / "python"
    return python if python.exists() else None


def digest(*paths, length=8):
    """The first digits of the SHA-256 of files, one after the other."""
    state = hashlib.sha256()
    for path in paths:
        state.update(Path(path).read_bytes())
    return state.hexdigest()[:length]


def program():
    """The program by the last commit that touched its sources, and by its bytes: a tree may be ahead of the build."""
    command = [
        "git",
        "-C",
        ROOT,
        "log",
        "-1",
        "--format=%h",
        "--abbrev=10",
        "--",
        "src",
        "ffi",
        "Cargo.toml",
        "Cargo.lock",
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return f"{done.stdout.strip() or 'unknown'}-{digest(BIN)}"


def scene_key(path):
    """A scene's folder: its name, and the digest of its bytes, so that a scene drawn anew is another one."""
    inside = path.is_relative_to(ROOT / "scenes")
    parts = path.relative_to(ROOT / "scenes").with_suffix("").parts if inside else ("twin", path.stem)
    return f"{'-'.join(parts)}-{digest(path)}"


@contextlib.contextmanager
def making(folder):
    """A folder under another name to make a work in; renamed at the end, removed where that is not reached."""
    draft = folder.with_name(f"{folder.name}.{os.getpid()}.part")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    try:
        yield draft
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def load(path):
    """A JSON file, or nothing where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def save(path, value):
    """A JSON file, whole or not at all."""
    draft = path.with_name(f"{path.name}.{os.getpid()}.part")
    draft.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    draft.rename(path)


class Failed(Exception):
    """A program ended with an error; the text is what it said last."""


def timed(command, limit=None, env=None):
    """Runs a program to its end; returns its stdout, the seconds, and the core-seconds of it and of what it started."""
    before, start = os.times(), time.perf_counter()
    try:
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, timeout=limit, env=env
        )
    except subprocess.TimeoutExpired as expired:
        raise Failed(f"took longer than {expired.timeout:g} s") from None
    after, seconds = os.times(), time.perf_counter() - start
    if done.returncode:
        raise Failed(
            " ".join((done.stderr or done.stdout).strip().splitlines()[-3:])[-300:] or f"exit code {done.returncode}"
        )
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return done.stdout, seconds, spent
