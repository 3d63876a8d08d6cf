"""Cost and error of motion blur."""

from .markdown import digits, table


def blur_cost(figures):
    """Table of the core-milliseconds of a moment, by scene."""
    costs = figures.one("blur")["cost_ms"]
    return table(["scene", "moment, ms"], [[f"`{name}`", digits(of["moment"])] for name, of in costs.items()])


def blur(figures):
    """Table of the estimated errors of blurred and still renders, and of means, by method."""
    runs = figures.one("blur")["methods"]
    rows = [
        [f"`{name}`", f"{of['blurred']:.3f}", f"{of['still']:.3f}", f"{of['mean_ratio']:.3f}"]
        for name, of in runs.items()
    ]
    return table(["method", "error, blurred", "error, still", "mean over that of `bdpt`"], rows)


def blur_peers(figures):
    """Table of the errors of delivered pictures of a blurred shot, by renderer."""
    head = ["renderer", "core-seconds", "relMSE", "trimmed", "FLIP", "mean over the reference's"]
    keys = ("core_seconds", "relmse", "relmse_trimmed", "flip", "mean_ratio")
    rows = figures.one("blur_peers")["rows"]
    return table(head, [[name, *(digits(row[key]) for key in keys)] for name, row in rows.items()])


KINDS = {"blur": blur, "blur-cost": blur_cost, "blur-peers": blur_peers}
