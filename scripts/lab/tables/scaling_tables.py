"""Tables of the growth of costs."""

from .markdown import table

# Titles of stored axes.
AXES = {"lamps": "lights"}


def scaling(figures):
    """Core-seconds at both ends of each axis, exponents, and the comparison with n log n."""
    rows = []
    for row in figures.one("scaling")["rows"]:
        ends = [f"{row[key][end]:,}" for key in ("sizes", "core_seconds") for end in (0, -1)]
        verdict = "no faster" if row["within"] else "faster"
        rows.append(
            [
                AXES.get(row["axis"], row["axis"]),
                row["method"],
                *ends,
                f"{row['exponent']:.2f}",
                f"{row['steepest']:.2f}",
                verdict,
            ]
        )
    head = ["size", "method", "from", "to", "core-s", "core-s", "exponent", "steepest step", "than n log n"]
    return table(head, rows)


def threads(figures):
    """Seconds of an iteration on one and on two threads."""
    rows = []
    for row in figures.one("scaling")["threads"]:
        one, two = row["seconds"]
        rows.append([f"`{row['method']}`", f"{one:.3f}", f"{two:.3f}", f"{one / two:.2f}"])
    return table(["method", "one thread, s", "two threads, s", "speed-up"], rows)


KINDS = {"scaling": scaling, "scaling-threads": threads}
