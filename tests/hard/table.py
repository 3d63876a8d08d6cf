"""The table of cases in docs/lab/hard-cases.md: `tests/hard-cases.sh --table` writes it anew."""

import re
from pathlib import Path

from . import families

DOCS = Path(__file__).resolve().parents[2] / "docs" / "lab" / "hard-cases.md"
BEGIN, END = "<!-- cases -->\n", "<!-- end of cases -->"


def table():
    """The table as Markdown."""
    rows = ["| case | what it tests | answer | by | known to fail |", "| --- | --- | --- | --- | --- |"]
    for case in families.cases():
        kind = type(case.answer).__name__.lower()
        fails = "; ".join(
            f"{', '.join(m for m, r in case.fails.items() if r == reason)}: {reason}"
            for reason in dict.fromkeys(case.fails.values())
        )
        title = case.title + (" (long form)" if case.long else "")
        rows.append(f"| `{case.name}` | {title} | {kind} | {', '.join(case.methods)} | {fails} |")
    return "\n".join(rows) + "\n"


def filled(text):
    """The page with its table renewed."""
    return re.sub(f"(?s){BEGIN}.*{END}", lambda _: BEGIN + "\n" + table() + "\n" + END, text)


def write():
    """Renews the page."""
    DOCS.write_text(filled(DOCS.read_text()))
