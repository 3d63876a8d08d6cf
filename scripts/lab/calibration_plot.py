"""Draws docs/lab/calibration.svg from the stored figure: estimated against true errors, one mark per picture."""

from .plots import pyplot, rows, save

# The largest ratio of estimated and true error that counts as correct.
FACTOR = 1.5


def main():
    found = [row for row in rows("calibration") if row[3] and row[4]]
    figure, axes = pyplot("calibration").subplots(figsize=(6.4, 5))
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
    save(figure, "calibration")


if __name__ == "__main__":
    main()
