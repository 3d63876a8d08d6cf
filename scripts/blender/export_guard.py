"""Keeps an export going: whatever fails is named in a warning, and replaced or left out."""

import contextlib
import sys
import traceback

# What may help where the export of a thing fails, by the first word of its name in warnings.
_REMEDIES = {"object": "apply its modifiers (Object > Apply > Visual Geometry to Mesh) and make it local",
             **dict.fromkeys(("material", "light", "world"), "simplify its nodes")}


@contextlib.contextmanager
def naming(where):
    """Adds to an error of the body, as `place`, the name of the thing that it concerns, unless it has one."""
    try:
        yield
    except Exception as error:
        error.place = getattr(error, "place", where)
        raise


def remedy(where):
    """What the user may do where the export of a thing fails."""
    known = _REMEDIES.get(where.split(" ")[0])
    return f"{known}, or report the error with the file" if known else "report the error with the file"


def attempt(warn, where, otherwise, instead, work, *arguments):
    """The result of `work(*arguments)`; if it raises, `otherwise`.

    `instead`: the end of the warning, which says what stands in. The traceback goes to stderr, for the developer.
    """
    try:
        return work(*arguments)
    except Exception as error:  # files from anywhere, many versions of Blender: no list of kinds could be complete
        traceback.print_exc(file=sys.stderr)
        where = getattr(error, "place", where)
        warn(where, f"it cannot be exported as it is ({summary(error)}): {instead}; {remedy(where)}")
        return otherwise


def summary(error):
    """The kind and the last line of an error: operators of Blender put a whole traceback into its text."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith("Location:")] or ["no message"]
    return f"{type(error).__name__}: {lines[-1][:200]}"


def exportable(things, works):
    """The things that can be exported together, and those that cannot, as two lists.

    `works(list)`: whether an export of these things succeeds.
    """
    good, bad = [], []

    def add(some):
        if not some:
            return
        if works(good + some):
            good.extend(some)
        elif len(some) == 1:
            bad.extend(some)
        else:
            add(some[:len(some) // 2])
            add(some[len(some) // 2:])

    add(list(things))
    return good, bad
