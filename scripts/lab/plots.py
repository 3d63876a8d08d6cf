"""Plots of stored figures, drawn by the Python of .venv-python (scripts/python.sh creates it)."""

import subprocess
import sys

from .record import ROOT, entries


def rows(name):
    """The stored rows of a figure."""
    return [row for entry in entries() if entry["name"] == name for row in entry["values"]["rows"]]


def draw(name):
    """Draws docs/lab/NAME.svg by NAME_plot.py, if .venv-python exists."""
    python = ROOT / ".venv-python" / "bin" / "python"
    if python.exists():
        subprocess.run([python, "-m", f"lab.{name}_plot"], check=True)
    else:
        print(
            f"docs/lab/{name}.svg is not drawn: scripts/python.sh creates .venv-python, which it needs", file=sys.stderr
        )


def pyplot(name):
    """matplotlib's pyplot, set up so that equal plots have equal bytes."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": name, "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot

    return pyplot


def save(figure, name):
    """Writes docs/lab/NAME.svg."""
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "lab" / f"{name}.svg", metadata={"Date": None})
