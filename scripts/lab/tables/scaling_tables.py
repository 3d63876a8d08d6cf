"""How costs grow with scenes and pictures."""

from .markdown import table


def scaling(figures):
    """Core-seconds at both ends of each axis, exponents, and the verdict."""
    rows = []
    for row in figures.one("scaling")["rows"]:
        ends = [f"{row[key][end]:,}" for key in ("sizes", "core_seconds") for end in (0, -1)]
        verdict = "no faster" if row["within"] else "faster"
        rows.append([row["axis"], row["method"], *ends, f"{row['exponent']:.2f}", f"{row['steepest']:.2f}", verdict])
    head = ["axis", "of", "from", "to", "core-s", "core-s", "exponent", "steepest step", "than n log n"]
    return table(head, rows)


def threads(figures):
    """Seconds of an iteration by threads."""
    rows = []
    for row in figures.one("scaling")["threads"]:
        one, two = row["seconds"]
        rows.append([f"`{row['method']}`", f"{one:.3f}", f"{two:.3f}", f"{one / two:.2f}"])
    return table(["method", "one thread, s", "two threads, s", "times as fast"], rows)


KINDS = {"scaling": scaling, "scaling-threads": threads}
