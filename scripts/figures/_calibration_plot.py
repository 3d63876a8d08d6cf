"""Draws docs/calibration.svg from the stored figure: told against true errors, one mark a picture."""

import json

import matplotlib
from record import RESULTS, ROOT

matplotlib.use("svg")
matplotlib.rcParams |= {"svg.hashsalt": "calibration", "svg.fonttype": "none", "font.size": 9}
from matplotlib import pyplot  # noqa: E402

# What counts as told right.
FACTOR = 1.5


def main():
    stored = [json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines()]
    rows = [row for entry in stored if entry["name"] == "calibration" for row in entry["values"]["rows"]]
    rows = [row for row in rows if row[3] and row[4]]
    figure, axes = pyplot.subplots(figsize=(6.4, 5))
    for index, name in enumerate(dict.fromkeys(row[0] for row in rows)):
        chosen = [row for row in rows if row[0] == name]
        mark = "os^Dv"[index // 10]
        axes.plot([row[4] for row in chosen], [row[3] for row in chosen], mark, ms=4, alpha=0.8, label=name)
    every = [value for row in rows for value in row[3:5]]
    ends = [min(every) / 1.3, max(every) * 1.3]
    axes.plot(ends, ends, color="0.3", lw=1)
    for factor in (FACTOR, 1 / FACTOR):
        axes.plot(ends, [factor * end for end in ends], color="0.6", lw=1, ls="--")
    axes.set(xscale="log", yscale="log", xlabel="true error of the finished picture", ylabel="error told by the render")
    axes.set(xlim=ends, ylim=ends)
    axes.legend(fontsize=7, ncol=2)
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "calibration.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
