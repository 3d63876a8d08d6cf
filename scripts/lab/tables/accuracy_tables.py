"""Tables of estimated errors, of renders with an error target, and of the cost of options."""

from .markdown import table


def calibration(figures):
    """Estimated over true errors of finished pictures."""
    values = figures.one("calibration")
    rows = []
    for part, of in values["parts"].items():
        if not of.get("told"):
            continue
        spread = f"{of['geometric_mean']:.2f} ({of['least']:.2f} to {of['most']:.2f})"
        counts = [f"{of[key]} of {of['told']}" for key in ("within", "inside")]
        rows.append([part, str(of["told"]), spread, *counts, f"{100 * of['pixels_within_2']:.0f} %"])
    columns = [
        "pictures",
        "number",
        "estimated over true",
        "within 1.5",
        "in the interval",
        "pixels within twice `Error`",
    ]
    return table(columns, rows)


def target(figures):
    """Renders with --target-error: their true errors, and their real and predicted times."""
    stops, predictions = figures.one("target"), {row["scene"]: row for row in figures.one("prediction")["rows"]}
    rows = []
    for row in stops["rows"]:
        known = predictions[row["scene"]]
        ratios = [row["longer"], known["predicted"], known["planned"]]
        cells = [row["scene"], f"{100 * row['error']:.1f} %", f"{row['true']:.2f}", f"{row['seconds']:.1f}"]
        rows.append([*cells, *("-" if ratio is None else f"{ratio:.2f}" for ratio in ratios)])
    columns = ["scene", "target", "true over target", "seconds", "over the shortest"]
    return table([*columns, "progress: predicted over real", "plan: predicted over real"], rows)


def knobs(figures):
    """Table of errors and core-seconds of renders, by option."""
    rows = []
    for group, label, options, spent, estimate, picture, gain, gain_finished, size in figures.one("knobs")["rows"]:
        errors = [f"{100 * error:.1f} %" for error in (estimate, picture)]
        gains = [f"{gain:.2f}", f"{gain_finished:.2f}"]
        # These renders do not write the layer of the estimate.
        if "--layers" in options:
            errors[0] = gains[0] = "-"
        rows.append([group, label, f"`{options}`", f"{spent:.1f}", *errors, *gains, f"{size:.1f}"])
    columns = ["group", "row", "options", "core-s", "estimate", "finished", "gain", "gain finished", "MB"]
    return table(columns, rows)


KINDS = {"calibration": calibration, "target": target, "knobs": knobs}
