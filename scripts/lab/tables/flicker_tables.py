"""The table of the flicker of animated shots."""

from .markdown import digits, table

HEAD = ["shot", "pictures", "flicker", "error of a frame", "flicker, all pixels", "error, all pixels"]
KEYS = ("flicker_trimmed", "error_trimmed", "flicker", "error")


def flicker(figures):
    """Flicker and error by shot and row; without the worst pixels, and of all."""
    rows = figures.one("flicker")["rows"]
    return table(HEAD, [[row["shot"], row["row"], *(digits(row[key]) for key in KEYS)] for row in rows])


KINDS = {"flicker": flicker}
