"""The program's own definition of its options (scripts/generate.sh writes the file)."""

import json
import pathlib

_DEFINED = json.loads(pathlib.Path(__file__).with_name("options.json").read_text("utf-8"))

#: Options, by the names of their fields, that a file may give.
FILES_MAY_GIVE = tuple(_DEFINED["files_may_give"])


def help_of(option, choice=None):
    """The help of an option, or of a name to choose for it."""
    entry = _DEFINED["panel"][option]
    return dict(entry["choices"])[choice] if choice else entry["help"]


def limits(option):
    """The smallest value of an option, and the largest that Blender can hold, as arguments of a property."""
    limits = _DEFINED["panel"][option]["range"]
    return {end: limits[end] for end in ("min", "max") if end in limits and abs(limits[end]) < 2**31}


def names(option):
    """Names to choose from."""
    return [name for name, _ in _DEFINED["panel"][option]["choices"]]
