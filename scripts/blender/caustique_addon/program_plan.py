"""What `caustique plan` says of a scene, and whom it names."""

import json
import re
import subprocess

from . import fault, handoff

_PATIENCE = 0.1  # seconds between two questions whether to give up
_CAUSTICS = ("caustic", "sds")


def read(words, folder, stopped):
    """The object that a command line with --json prints in a folder. `stopped` is asked whether to give up."""
    process = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, errors="replace")
    while True:
        try:
            said, told = process.communicate(timeout=_PATIENCE)
            break
        except subprocess.TimeoutExpired:
            if stopped():
                process.kill()
                process.communicate()
                raise fault.Cancelled() from None
    if process.returncode != 0:
        lines = [handoff.without_file(line) for line in told.splitlines() if not line.startswith("warning: ")]
        raise fault.fault_from_program(lines, process.returncode)
    try:
        return json.loads(said)
    except ValueError as error:
        raise fault.Fault("the program's plan cannot be read", "update the program and the add-on together") from error


def headline(said):
    """What a plan says of caustics, in a sentence."""
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
    """Why the scene has caustics, a list of lines."""
    return [reason for effect in said["effects"] if effect["name"] in _CAUSTICS for reason in effect["because"]]


def named_objects(scene, lines):
    """The objects of a scene that lines like `object "A": ..` or `material "B" on "C": ..` name, each once.

    A material stands for all that wear it, for lists of objects are cut where they are long.
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
