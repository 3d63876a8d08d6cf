"""The learned combiner: its networks on held-out views, at equal time, and its cost."""

from statistics import geometric_mean

from .markdown import digits, table


def relative(cells, name, key="relmse_trimmed"):
    """The geometric mean over the cells that have a row of its error relative to `sppm`."""
    found = [cell["rows"] for cell in cells if name in cell["rows"]]
    return geometric_mean(max(rows[name][key], 1e-6) / max(rows["sppm"][key], 1e-6) for rows in found)


def training(figures):
    """Table of the training of the networks, and of their errors on held-out views relative to the usual pictures."""
    head = ["network", "steps", "minutes", "`sppm` to level 4", "`sppm` to the finish", "`vcm` to level 4"]
    keys = ("sppm_to_level4", "sppm_to_finished", "vcm_to_level4")
    rows = [
        [f"`{name}`", f"{line['step']}", f"{line['seconds'] / 60:.0f}", *(digits(line.get(key)) for key in keys)]
        for name, line in figures.one("training")["runs"].items()
    ]
    return table(head, rows)


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


def paper(figures):
    """Table of the relMSE by scene and budget, beside the gains that the 2021 paper reports."""
    networks, others, rows = ("levels-only", "paper", "deep-multi"), ("path, OIDN", "sppm, finished"), []
    for cell in figures.one("combiner")["cells"]:
        errors = {name: of["relmse_trimmed"] for name, of in cell["rows"].items()}
        best = min((name for name in errors if name not in ("sppm", *others)), key=errors.get)
        ratios = [errors[name] / errors["sppm"] if name in errors else None for name in networks + others]
        before, after = cell["paper"]
        found = [f"`{cell['scene']}`", f"{cell['budget']:g}", digits(errors["sppm"]), *map(digits, ratios)]
        rows.append([*found, f"{digits(errors[best] / errors['sppm'])} (`{best}`)", f"{after / before:.2f}"])
    head = ["scene", "core-s", "`sppm`", *(f"`{name}`" for name in networks + others), "best network", "reported gain"]
    return table(head, rows)


def cost(figures):
    """Table of the time and memory of finishing a picture with and without a network."""
    values = figures.one("combiner_cost")
    keys = ("seconds", "core_seconds", "peak_mib")
    rows = [[name, *(f"{run[key]:.3g}" for key in keys)] for name, run in values["runs"].items()]
    return table(["finish of 1280x720 pixels", "seconds", "core-seconds", "peak memory, MiB"], rows)


KINDS = {
    "combiner-training": training,
    "combiner": equal_time,
    "combiner-paper": paper,
    "combiner-cost": cost,
}
