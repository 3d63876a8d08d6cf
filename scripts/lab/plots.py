"""Plots of stored figures, which .venv-python draws (scripts/python.sh)."""

import subprocess
import sys

from .record import ROOT, entries


def rows(name):
    """The rows that are stored of a figure."""
    return [row for entry in entries() if entry["name"] == name for row in entry["values"]["rows"]]


def draw(name):
    """Draws docs/lab/NAME.svg by NAME_plot.py, if .venv-python is there."""
    python = ROOT / ".venv-python" / "bin" / "python"
    if python.exists():
        subprocess.run([python, "-m", f"lab.{name}_plot"], check=True)
    else:
        print(f"docs/lab/{name}.svg is as it was: scripts/python.sh makes what draws it", file=sys.stderr)


def pyplot(name):
    """What draws a picture, with the same bytes each time."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": name, "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot

    return pyplot


def save(figure, name):
    """Writes docs/lab/NAME.svg."""
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "lab" / f"{name}.svg", metadata={"Date": None})
