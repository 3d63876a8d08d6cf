"""Runs `caustique plan` on a scene, and finds the objects that its messages name."""

import json
import re
import subprocess

from . import fault, wording

_POLL_SECONDS = 0.1  # between two checks for cancellation
_CAUSTICS = ("caustic", "sds")


def read(words, folder, stopped):
    """Run a command line with --json in a folder. Returns the printed object. `stopped()` is true to cancel."""
    process = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, errors="replace")
    while True:
        try:
            said, messages = process.communicate(timeout=_POLL_SECONDS)
            break
        except subprocess.TimeoutExpired:
            if stopped():
                process.kill()
                process.communicate()
                raise fault.Cancelled() from None
    if process.returncode != 0:
        lines = [wording.of_interface(line) for line in messages.splitlines() if not line.startswith("warning: ")]
        raise fault.fault_from_program(lines, process.returncode)
    try:
        plan = json.loads(said)
    except ValueError as error:
        raise fault.Fault("the program's plan cannot be read", "update the program and the add-on together") from error
    plan["warnings"] = [wording.of_interface(line) for line in plan["warnings"]]
    return plan


def headline(said):
    """One sentence that says whether caustics are rendered, from `said`, the program's plan of the render."""
    caustics = [effect for effect in said["effects"] if effect["name"] in _CAUSTICS]
    rendered = [effect for effect in caustics if effect["simulated"]]
    if rendered:
        shares = [effect["energy"] for effect in rendered if effect.get("energy") is not None]
        share = f", {100 * sum(shares):.2g} % of the light" if shares else ""
        return f"Caustics are rendered, by {rendered[0]['by']}{share}"
    if any(effect.get("present") for effect in caustics):
        return "The scene has caustics, and they are left out: see Effects and Method"
    return "Nothing in the scene casts a caustic: a lamp has to shine on smooth glass or metal"


def reasons(said):
    """The reasons for caustics in the scene, a list of lines."""
    return [reason for effect in said["effects"] if effect["name"] in _CAUSTICS for reason in effect["because"]]


def named_objects(scene, lines):
    """The objects of a scene named by lines such as `object "A": ..` or `material "B" on "C": ..`, each once.

    A material stands for all objects that use it, because messages shorten long lists of objects.
    """
    found = {}
    for line in lines:
        for kind, name in re.findall(r'(\w*) ?"([^"]+)"', line):
            if kind == "material":
                things = [thing for thing in scene.objects
                          if any(slot.material is not None and slot.material.name == name
                                 for slot in thing.material_slots)]
            elif kind in {"world", "image"}:
                things = []
            else:
                things = [thing for thing in scene.objects if thing.name == name]
            found.update((thing.name, thing) for thing in things)
    return list(found.values())
