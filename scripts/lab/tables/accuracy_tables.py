"""Tables of estimated errors, and of renders with an error target."""

from .markdown import table


def calibration(figures):
    """Estimated over true errors of finished pictures, by budget, without the parts by scene."""
    values = figures.one("calibration")
    rows = []
    for part, of in values["parts"].items():
        if not of.get("told") or not part.endswith((" s", "all", "warned of")):
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
    """Renders with --target-error: their true errors, and their real times and those predicted meanwhile."""
    stops, predictions = figures.one("target"), {row["scene"]: row for row in figures.one("prediction")["rows"]}
    rows = []
    for row in stops["rows"]:
        known = predictions[row["scene"]]
        ratios = [row["longer"], known["predicted"]]
        cells = [row["scene"], f"{100 * row['error']:.1f} %", f"{row['true']:.2f}", f"{row['seconds']:.1f}"]
        rows.append([*cells, *("-" if ratio is None else f"{ratio:.2f}" for ratio in ratios)])
    columns = ["scene", "target", "true over target", "seconds", "over the shortest"]
    return table([*columns, "progress: predicted over real"], rows)


def outlook(figures):
    """Predictions of plan --target-error, and the renders."""
    rows = []
    for row in figures.one("outlook")["rows"]:
        cells = []
        for predicted, needed in zip(row["predicted"], row["needed"]):
            ratio = f"{predicted / needed:.2f}" if predicted and row["reached"] else "-"
            cells += ["-" if value is None else f"{value:.0f}" for value in (predicted, needed)] + [ratio]
        rows.append([row["scene"], *cells])
    kinds = ("iterations", "core-seconds")
    columns = [cell for kind in kinds for cell in (f"{kind}, predicted", "needed", "ratio")]
    return table(["scene", *columns], rows)


KINDS = {"calibration": calibration, "target": target, "outlook": outlook}
