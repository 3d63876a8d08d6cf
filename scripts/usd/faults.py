"""What is wrong with a stage: an error that ends the conversion, and what is lost on the way."""


class Fault(Exception):
    """An error at a prim (or a file): what is wrong there, and what to do about it."""

    def __init__(self, where, fault, hint=None):
        super().__init__(f"{where}: {fault}")
        self.where, self.fault, self.hint = str(where), fault, hint


def text_of(error):
    """What an error of USD's says, on one line; its words may hold bytes of the file that are no text."""
    try:
        return " ".join(str(error).split()) or type(error).__name__
    except UnicodeDecodeError:
        return "the file holds bytes that are not UTF-8"


class Losses:
    """What is ignored or approximated: a line each, once."""

    def __init__(self):
        self.lines = []

    def add(self, where, what):
        """`what` is lost of the prim at `where`."""
        line = f"{where}: {what}"
        if line not in self.lines:
            self.lines.append(line)
