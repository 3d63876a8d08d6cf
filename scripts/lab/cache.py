"""The cache of renders: a later run, or one that continues an interrupted one, finds them there.

Each render has a folder. It is created under a temporary name and renamed when it is complete, so a folder in the cache
is always complete.
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
    """The Python of a virtual environment in the repository, or None."""
    python = ROOT / venv / "bin" / "python"
    return python if python.exists() else None


def digest(*paths, length=8):
    """The first digits of the SHA-256 of the concatenated files."""
    state = hashlib.sha256()
    for path in paths:
        state.update(Path(path).read_bytes())
    return state.hexdigest()[:length]


def program(binary=BIN):
    """A key of a program: the last commit that touched its sources, and a digest of its bytes, because the build may
    be older than the sources."""
    command = ["git", "-C", ROOT, "log", "-1", "--format=%h", "--abbrev=10", "--"]
    command += ["src", "ffi", "Cargo.toml", "Cargo.lock"]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return f"{done.stdout.strip() or 'unknown'}-{digest(binary)}"


def scene_key(path):
    """The name of a scene's folder: the scene's name, and a digest of its bytes, which changes with the scene."""
    inside = path.is_relative_to(ROOT / "scenes")
    parts = path.relative_to(ROOT / "scenes").with_suffix("").parts if inside else (outside(path), path.stem)
    return f"{'-'.join(parts)}-{digest(path)}"


def outside(path):
    """The kind of a scene outside the project's folder of scenes: an animated shot, a still of one, a twin, or a user's file."""
    return {"shots": "shot", "stills": "still", "twins": "twin"}.get(path.parent.name, "file")


def frame_suffix(frame):
    """The end of the name of a folder that holds one frame; empty for a scene that does not move."""
    return "" if frame is None else f"-frame{frame}"


@contextlib.contextmanager
def create(folder):
    """Creates a folder under a temporary name, renames it at the end, and removes it after an exception."""
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
    """The value of a JSON file, or None if there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def save(path, value):
    """Writes a JSON file atomically."""
    draft = path.with_name(f"{path.name}.{os.getpid()}.part")
    draft.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    draft.rename(path)


class Failed(Exception):
    """A program has ended with an error; the text is the end of its output."""


def run_timed(command, limit=None, env=None):
    """Runs a program to its end; returns its stdout, the seconds, and the core-seconds, with its child processes."""
    before, start = os.times(), time.perf_counter()
    try:
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=limit, env=env)
    except subprocess.TimeoutExpired as expired:
        raise Failed(f"took longer than {expired.timeout:g} s") from None
    after, seconds = os.times(), time.perf_counter() - start
    if done.returncode:
        raise Failed(
            " ".join((done.stderr or done.stdout).strip().splitlines()[-3:])[-300:] or f"exit code {done.returncode}"
        )
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return done.stdout, seconds, spent
