"""What goes wrong, in the words that Blender shows."""

import textwrap
import traceback

_WIDTH = 100  # letters of a line of Blender's messages, which do not wrap by themselves


class Fault(Exception):
    """A fault that the user can do something about: what it is, and the remedy."""

    def __init__(self, what, remedy=""):
        self.what, self.remedy = what, remedy
        super().__init__(f"{what}\nRemedy: {remedy}" if remedy else what)

    def message(self):
        """The text with lines short enough for a message of Blender's."""
        return "\n".join(textwrap.fill(line, _WIDTH) for line in str(self).splitlines())


class Cancelled(Exception):
    """The user has stopped the work."""


def fault_from_error(error):
    """Any exception as a Fault. One that nobody foresaw is printed, too, for whoever mends it."""
    if isinstance(error, Fault):
        return error
    traceback.print_exception(type(error), error, error.__traceback__)
    return Fault(f"the add-on has failed: {type(error).__name__}: {error}",
                 "report it with the scene, and with what Blender has printed to its console")


def fault_from_program(lines, code):
    """The Fault that the program tells of: its lines on stderr (what, then `hint: ` and the remedy), its exit code."""
    what, remedy = [], []
    for line in lines:
        (remedy if line.startswith("hint: ") or remedy else what).append(line)
    if not what:
        ended = f"by signal {-code}" if code < 0 else f"with code {code}"
        return Fault(f"caustique ended {ended} and said nothing", "report it with the scene")
    return Fault("; ".join(what), " ".join(remedy).replace("hint: ", "", 1))
