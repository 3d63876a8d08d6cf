"""What is wrong with a stage: an error that ends the conversion, and what is lost on the way."""


class Fault(Exception):
    """An error at a prim (or a file): what is wrong there, and what to do about it."""

    def __init__(self, where, fault, hint=None):
        super().__init__(f"{where}: {fault}")
        self.where, self.fault, self.hint = str(where), fault, hint


class Losses:
    """What is ignored or approximated: a line each, once."""

    def __init__(self):
        self.lines = []

    def name(self, where, what):
        """`what` is lost of the prim at `where`."""
        line = f"{where}: {what}"
        if line not in self.lines:
            self.lines.append(line)
