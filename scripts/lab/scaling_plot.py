"""Draws docs/lab/scaling.svg from the stored figure: core-seconds of an iteration, and of loading, by size."""

from .plots import pyplot, rows, save
from .tables.scaling_tables import AXES


def main():
    found, plot = rows("scaling"), pyplot("scaling")
    axes_of = list(dict.fromkeys(row["axis"] for row in found))
    figure, places = plot.subplots(2, 2, figsize=(7, 5.4), squeeze=True)
    for axis, place in zip(axes_of, places.flat):
        for row in (row for row in found if row["axis"] == axis):
            place.plot(row["sizes"], row["core_seconds"], "o-", ms=3, lw=1, label=row["method"])
        place.set(xscale="log", yscale="log", xlabel=AXES.get(axis, axis), ylabel="core-seconds")
        place.legend(fontsize=7)
    save(figure, "scaling")


if __name__ == "__main__":
    main()
