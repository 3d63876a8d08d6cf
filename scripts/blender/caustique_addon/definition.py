"""Reads the program's definition of its options from options.json, which scripts/generate.sh writes."""

import json
import pathlib

_DEFINED = json.loads(pathlib.Path(__file__).with_name("options.json").read_text("utf-8"))

#: Options allowed in a .blend, by field name.
FILES_MAY_GIVE = tuple(_DEFINED["files_may_give"])


def help_of(option, choice=None):
    """The help text of an option, or of one of its choices."""
    entry = _DEFINED["panel"][option]
    return dict(entry["choices"])[choice] if choice else entry["help"]


def limits(option):
    """Limits of an option, within Blender's range, as keyword arguments of a property."""
    limits = _DEFINED["panel"][option]["range"]
    return {end: limits[end] for end in ("min", "max") if end in limits and abs(limits[end]) < 2**31}


def names(option):
    """The names of an option's choices."""
    return [name for name, _ in _DEFINED["panel"][option]["choices"]]
