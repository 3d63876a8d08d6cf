"""Draws docs/lab/calibration.svg from the stored figure: estimated against true errors, one mark per picture. Run by the
Python of .venv-python, which has matplotlib.
"""

import matplotlib

from .record import ROOT, entries

# The largest ratio of estimated and true error that counts as correct.
FACTOR = 1.5


def main():
    # Equal plots have equal bytes.
    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": "calibration", "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot

    stored = next(entry["values"]["rows"] for entry in entries() if entry["name"] == "calibration")
    found = [row for row in stored if row[3] and row[4]]
    figure, axes = pyplot.subplots(figsize=(6.4, 5))
    for index, name in enumerate(dict.fromkeys(row[0] for row in found)):
        chosen = [row for row in found if row[0] == name]
        mark = "os^Dv"[index // 10]
        axes.plot([row[4] for row in chosen], [row[3] for row in chosen], mark, ms=4, alpha=0.8, label=name)
    every = [value for row in found for value in row[3:5]]
    ends = [min(every) / 1.3, max(every) * 1.3]
    axes.plot(ends, ends, color="0.3", lw=1)
    for factor in (FACTOR, 1 / FACTOR):
        axes.plot(ends, [factor * end for end in ends], color="0.6", lw=1, ls="--")
    axes.set(xscale="log", yscale="log", xlabel="true error of the finished picture", ylabel="estimated error")
    axes.set(xlim=ends, ylim=ends)
    axes.legend(fontsize=7, ncol=2)
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "lab" / "calibration.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
