"""What a render tells of its error, what a target stops at, and what knobs cost."""

from .markdown import table


def percent(share):
    """A share for people."""
    return f"{100 * share:.0f} %"


def calibration(figures):
    """Told over true errors of finished pictures."""
    values = figures.one("calibration")
    rows = []
    for part, of in values["parts"].items():
        if not of.get("told"):
            continue
        spread = f"{of['geometric_mean']:.2f} ({of['least']:.2f} to {of['most']:.2f})"
        counts = [f"{of[key]} of {of['told']}" for key in ("within", "inside")]
        rows.append([part, str(of["told"]), spread, *counts, percent(of["pixels_within_2"])])
    columns = ["pictures", "number", "told over true", "within 1.5", "in the interval", "pixels within twice `Error`"]
    return table(columns, rows)


def target(figures):
    """What --target-error stops at, and what was said of it before."""
    stops, said = figures.one("target"), {row["scene"]: row for row in figures.one("prediction")["rows"]}
    rows = []
    for row in stops["rows"]:
        told = said[row["scene"]]
        figure = [f"{told[key]:.2f}" if told[key] is not None else "-" for key in ("predicted", "planned")]
        longer = f"{row['longer']:.2f}" if row["longer"] is not None else "-"
        rows.append(
            [
                row["scene"],
                f"{100 * row['error']:.1f} %",
                f"{row['true']:.2f}",
                f"{row['seconds']:.1f}",
                longer,
                *figure,
            ]
        )
    columns = [
        "scene",
        "asked",
        "true over asked",
        "seconds",
        "over the shortest",
        "progress: told over real",
        "plan: told over real",
    ]
    return table(columns, rows)


def knobs(figures):
    """Error and time by knob."""
    rows = []
    for group, label, options, spent, estimate, picture, gain, gain_finished, size in figures.one("knobs")["rows"]:
        errors = [f"{100 * error:.1f} %" for error in (estimate, picture)]
        gains = [f"{gain:.2f}", f"{gain_finished:.2f}"]
        # Without the layer there is no estimate to measure.
        if "--layers" in options:
            errors[0] = gains[0] = "-"
        rows.append([group, label, f"`{options}`", f"{spent:.1f}", *errors, *gains, f"{size:.1f}"])
    columns = ["knob", "", "options", "core-s", "estimate", "finished", "gain", "gain finished", "MB"]
    return table(columns, rows)


KINDS = {"calibration": calibration, "target": target, "knobs": knobs}
