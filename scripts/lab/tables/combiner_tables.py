"""The table of trained combiners."""

from .markdown import digits, table


def combiner(figures):
    """The trimmed relMSE of each picture relative to plain sppm, by scene and core-seconds; plain sppm itself in full."""
    values = figures.one("combiner")
    cells, means = values["cells"], values["geometric_means"]
    head = ["pictures", *(f"{cell['scene']}, {cell['budget']:g} s" for cell in cells), "mean"]
    error = lambda cell, name: cell["rows"][name]["relmse_trimmed"]
    rows = [["sppm: relMSE", *(digits(error(cell, "sppm")) for cell in cells), ""]]
    for name, mean in means.items():
        if name != "sppm":
            known = [digits(error(cell, name) / error(cell, "sppm")) if name in cell["rows"] else "-" for cell in cells]
            rows.append([name, *known, digits(mean)])
    return table(head, rows)


KINDS = {"combiner": combiner}
