"""Errors for the user, and their text in Blender's interface."""

import textwrap
import traceback

_MAX_LINE_LETTERS = 100  # in Blender's messages, which do not wrap


class Fault(Exception):
    """An error that the user can fix: the fault and its remedy."""

    def __init__(self, what, remedy=""):
        self.what, self.remedy = what, remedy
        super().__init__(f"{what}\nRemedy: {remedy}" if remedy else what)

    def message(self):
        """The text, wrapped for Blender's messages."""
        return "\n".join(textwrap.fill(line, _MAX_LINE_LETTERS) for line in str(self).splitlines())


class Cancelled(Exception):
    """The user has cancelled the work."""


def fault_from_error(error):
    """Convert any exception to a Fault. The traceback of an unexpected one is also printed, for the developer."""
    if isinstance(error, Fault):
        return error
    traceback.print_exception(type(error), error, error.__traceback__)
    return Fault(f"the add-on has failed: {type(error).__name__}: {error}",
                 "report it with the scene, and with what Blender has printed to its console")


def fault_from_program(lines, code):
    """The Fault of a failed program, from its lines on stderr (error, then `hint: ` and the remedy) and its exit
    code."""
    what, remedy = [], []
    for line in lines:
        (remedy if line.startswith("hint: ") or remedy else what).append(line)
    if not what:
        ended = f"by signal {-code}" if code < 0 else f"with code {code}"
        return Fault(f"caustique ended {ended} and said nothing", "report it with the scene")
    return Fault("; ".join(what), " ".join(remedy).replace("hint: ", "", 1))
