"""The figures that lab/record.py has stored, and their commits and machines."""

import json
import textwrap

from ..record import RESULTS

WIDTH = 120


class Missing(Exception):
    """A table needs a figure that is not stored."""


class Figures:
    """The stored figures of one set (None for figures without sets); remembers the figures that a table uses."""

    def __init__(self, of=None, file=RESULTS):
        self.of = of
        self.rows = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        self.used = []

    def all(self, name, **known):
        """The values of all figures of a name whose values contain `known`, sorted by scene."""
        known["set"] = self.of
        found = [row for row in self.rows if row["name"] == name]
        found = [row for row in found if all(row["values"].get(key) == value for key, value in known.items())]
        if not found:
            raise Missing(f"no figure {name!r} with {known} is stored")
        self.used += found
        return sorted((row["values"] for row in found), key=lambda values: values.get("scene", ""))

    def one(self, name, **known):
        """The values of the only figure of a name whose values contain `known`."""
        values = self.all(name, **known)
        if len(values) > 1:
            raise Missing(f"{len(values)} figures {name!r} with {known} are stored, not one")
        return values[0]

    def source(self):
        """Commit, date and machine of the figures in use: one line, or a list of figures if they differ."""
        names = {}
        for row in self.used:
            of = names.setdefault(origin(row), [])
            of += [label for label in [row["values"].get("scene") or row["name"]] if label not in of]
        if len(names) == 1:
            return textwrap.fill(f"Measured at {next(iter(names))}.", WIDTH) + "\n"
        lines = [f"- {', '.join(labels)}: {one}." for one, labels in names.items()]
        return "".join(textwrap.fill(line, WIDTH, subsequent_indent="  ") + "\n" for line in lines)


def origin(row):
    """Commit, date and machine of a stored figure."""
    machine = row["machine"]
    return (
        f"commit {row['commit'][:10]}, {row['date'][:10]}, "
        f"{machine['cores']} cores of {machine['cpu']}, {machine['memory_gib']:g} GiB, {machine['system']}"
    )
