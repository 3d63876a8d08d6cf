"""The learned combiner: its networks on held-out views, at equal time, and its cost."""

from statistics import geometric_mean

from .markdown import digits, table


def relative(cells, name, key="relmse_trimmed"):
    """The geometric mean over the cells that have a row of its error relative to `sppm`; None if none has it."""
    found = [cell["rows"] for cell in cells if name in cell["rows"]]
    if not found:
        return None
    return geometric_mean(max(rows[name][key], 1e-6) / max(rows["sppm"][key], 1e-6) for rows in found)


def equal_time(figures):
    """Table of the errors relative to `sppm` at equal core-seconds: geometric means over the budgets, by scene."""
    cells = figures.one("combiner")["cells"]
    scenes, names = ({key: None for key in keys} for keys in ([c["scene"] for c in cells], all_rows(cells)))
    of = lambda scene: [cell for cell in cells if scene in (None, cell["scene"])]
    rows = []
    for name in names:
        ratios = [relative(of(scene), name) for scene in (*scenes, None)]
        cost = max(cell["rows"][name]["network_core_seconds"] for cell in cells if name in cell["rows"])
        rows.append([f"`{name}`", *map(digits, ratios), digits(relative(cells, name, "flip")), digits(cost or None)])
    return table(["picture", *(f"`{scene}`" for scene in scenes), "all", "FLIP, all", "network, s"], rows)


def all_rows(cells):
    """The names of the rows of all cells, in order."""
    return [name for cell in cells for name in cell["rows"]]


KINDS = {"combiner": equal_time}
