"""Errors that end the conversion of a stage, and losses that do not."""


class Fault(Exception):
    """An error at a prim or a file: the fault and its remedy."""

    def __init__(self, where, fault, hint=None):
        super().__init__(f"{where}: {fault}")
        self.where, self.fault, self.hint = str(where), fault, hint


def text_of(error):
    """The text of an error of USD on one line. It may contain bytes of the file that are not UTF-8."""
    try:
        return " ".join(str(error).split()) or type(error).__name__
    except UnicodeDecodeError:
        return "the file holds bytes that are not UTF-8"


class Losses:
    """Features that are ignored or approximated, one line each, without duplicates."""

    def __init__(self):
        self.lines = []

    def add(self, where, what):
        """Record that the prim at `where` loses `what`."""
        line = f"{where}: {what}"
        if line not in self.lines:
            self.lines.append(line)
