"""What lab/record.py has stored, and where it comes from."""

import json
import textwrap

from ..record import RESULTS

WIDTH = 120


class Missing(Exception):
    """A table asks for a figure that is not stored."""


class Figures:
    """The stored figures of one set, None where figures have no sets; keeps in mind which of them a table has used."""

    def __init__(self, of=None, file=RESULTS):
        self.of = of
        self.rows = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        self.used = []

    def all(self, name, having=None, **known):
        """Values of all figures of a name that agree with what is known of their values, sorted by scene.

        `having`: a key that they must have.
        """
        known["set"] = self.of
        found = [row for row in self.rows if row["name"] == name and (having is None or having in row["values"])]
        found = [row for row in found if all(row["values"].get(key) == value for key, value in known.items())]
        if not found:
            raise Missing(f"no figure {name!r} with {known} is stored")
        self.used += found
        return sorted((row["values"] for row in found), key=lambda values: values.get("scene", ""))

    def one(self, name, **known):
        """Values of the figure that was stored last."""
        values = self.all(name, **known)
        if len(values) > 1:
            raise Missing(f"{len(values)} figures {name!r} with {known} are stored, not one")
        return values[0]

    def source(self):
        """Commit, date and machine of what was used: one line, or where there are several a list with what is whose."""
        names = {}
        for row in self.used:
            of = names.setdefault(origin(row), [])
            of += [label for label in [row["values"].get("scene") or row["name"]] if label not in of]
        if len(names) == 1:
            return textwrap.fill(f"Measured at {next(iter(names))}.", WIDTH) + "\n"
        lines = [f"- {', '.join(labels)}: {one}." for one, labels in names.items()]
        return "".join(textwrap.fill(line, WIDTH, subsequent_indent="  ") + "\n" for line in lines)


def origin(row):
    """Commit, date and machine of a figure."""
    commit, _, dirty = row["commit"].partition("-")
    machine = row["machine"]
    return (
        f"commit {commit[:10]}{' with uncommitted changes' if dirty else ''}, {row['date'][:10]}, "
        f"{machine['cores']} cores of {machine['cpu']}, {machine['memory_gib']:g} GiB, {machine['system']}"
        f"{', carried over from what was printed' if row.get('carried') else ''}"
    )
