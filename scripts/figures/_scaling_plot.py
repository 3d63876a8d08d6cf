"""Draws docs/scaling.svg from the stored figure: core-seconds of an iteration, and of loading, along each axis."""

import json

import matplotlib
from record import RESULTS, ROOT

matplotlib.use("svg")
matplotlib.rcParams |= {"svg.hashsalt": "scaling", "svg.fonttype": "none", "font.size": 9}
from matplotlib import pyplot  # noqa: E402


def main():
    stored = [json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines()]
    rows = [row for entry in stored if entry["name"] == "scaling" for row in entry["values"]["rows"]]
    axes_of = list(dict.fromkeys(row["axis"] for row in rows))
    figure, places = pyplot.subplots(2, 2, figsize=(7, 5.4), squeeze=True)
    for axis, place in zip(axes_of, places.flat):
        for row in (row for row in rows if row["axis"] == axis):
            place.plot(row["sizes"], row["core_seconds"], "o-", ms=3, lw=1, label=row["method"])
        place.set(xscale="log", yscale="log", xlabel=axis, ylabel="core-seconds")
        place.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "scaling.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
