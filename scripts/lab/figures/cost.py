"""The predicted cost of an iteration in `--method auto` beside the measured cost, by scene and candidate."""

from ..bench import measure
from ..record import ROOT


def main():
    measure("cost", "counted-cost", *sorted((ROOT / "scenes").glob("*.glb")), "width=320")
