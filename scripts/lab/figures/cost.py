"""What `--method auto` takes an iteration to cost beside what it costs, by scene and candidate."""

from ..bench import measure
from ..record import ROOT


def main():
    measure("cost", "counted-cost", *sorted((ROOT / "scenes").glob("*.glb")), "width=320")
