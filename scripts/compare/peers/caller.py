"""Runs drivers of other renderers and reads their answers, for Python scripts. The program has its own version
(src/peers)."""

import json
import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
DRIVERS = Path(__file__).resolve().parent
#: OpenEXR for Blender's Python module, in a separate folder.
PACKAGES = ROOT / ".venv-peers" / "bpy"
#: Prefix of the line with a driver's answer (driver.py).
ANSWER_PREFIX = "PEER "


class CannotTranslate(Exception):
    """The renderer cannot represent the scene; the message says why."""


def command(driver, scene, target, **options):
    """The command line of a driver. `options`: its options, with _ for -."""
    venv = ".venv-bpy" if driver.startswith("cycles") else ".venv-peers"
    words = [ROOT / venv / "bin" / "python", DRIVERS / driver, scene, target]
    words += [word for key, value in options.items() for word in (f"--{key.replace('_', '-')}", value)]
    return [str(word) for word in words]


def environment(driver):
    """The environment variables of a driver's process."""
    return {**os.environ, **({"PYTHONPATH": str(PACKAGES)} if driver.startswith("cycles") else {})}


def answer(output):
    """The answer of a driver as a dict, or None if it printed none. Raises `CannotTranslate` for unsupported scenes."""
    lines = [line for line in output.splitlines() if line.startswith(ANSWER_PREFIX)]
    if not lines:
        return None
    facts = json.loads(lines[-1][len(ANSWER_PREFIX) :])
    if "cannot" in facts:
        raise CannotTranslate("; ".join(facts["cannot"]))
    return facts
