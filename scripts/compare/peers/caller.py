"""Runs drivers of other renderers and reads their answers, for the scripts that compare; the program has its own
(src/peers)."""

import json
import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
DRIVERS = Path(__file__).resolve().parent
#: OpenEXR for Blender's module lies apart.
PACKAGES = ROOT / ".venv-peers" / "bpy"
#: The line of a driver's answer begins so (driver.py).
MARK = "PEER "


class CannotTranslate(Exception):
    """The renderer cannot represent the scene; the message says why."""


def command(driver, scene, target, **options):
    """The words that call a driver. `options`: its options, with _ for -."""
    venv = ".venv-bpy" if driver.startswith("cycles") else ".venv-peers"
    words = [ROOT / venv / "bin" / "python", DRIVERS / driver, scene, target]
    words += [word for key, value in options.items() for word in (f"--{key.replace('_', '-')}", value)]
    return [str(word) for word in words]


def environment(driver):
    """The variables of a driver's process."""
    return {**os.environ, **({"PYTHONPATH": str(PACKAGES)} if driver.startswith("cycles") else {})}


def answer(output):
    """What a driver has answered, as a dict; None where it has not. A scene that it cannot translate is `CannotTranslate`."""
    lines = [line for line in output.splitlines() if line.startswith(MARK)]
    if not lines:
        return None
    facts = json.loads(lines[-1][len(MARK) :])
    if "cannot" in facts:
        raise CannotTranslate("; ".join(facts["cannot"]))
    return facts
