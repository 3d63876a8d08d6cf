"""Errors that end the conversion of a stage, and losses that do not."""


# Longest text of a message: a stage may name prims, and USD may quote files, of any length.
_MAX_LENGTH = 500


class Fault(Exception):
    """An error at a prim or a file: the fault and its remedy."""

    def __init__(self, where, fault, hint=None):
        self.where, self.fault, self.hint = _shortened(where), _shortened(fault), hint
        super().__init__(f"{self.where}: {self.fault}")


class Invalid(Fault):
    """A fault of one prim. As in other renderers of OpenUSD it is a loss: what it makes unusable is left out."""


def check_pointer(start, where):
    """Raise a Fault if a file that starts with the bytes `start` is a pointer of Git LFS."""
    if start.startswith(b"version https://git-lfs.github.com/spec/"):
        raise Fault(where, "the file is a pointer of Git LFS, not the file that it stands for",
                    "run 'git lfs pull' in its folder")


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
        line = f"{_shortened(where)}: {_shortened(what)}"
        if line not in self.lines:
            self.lines.append(line)


def _shortened(text):
    """A text of at most `_MAX_LENGTH` characters."""
    text = str(text)
    return text if len(text) <= _MAX_LENGTH else text[:_MAX_LENGTH] + " ..."
