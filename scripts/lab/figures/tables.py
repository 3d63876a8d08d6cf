"""Writes the tables of docs/ from the stored figures (results.jsonl).

A table is between a line `<!-- table: NAME -->`, or `<!-- table: NAME SET -->` for figures with sets, and the next
`<!-- end -->`. Commit, date and machine are above each table. lab/tables has the tables by name.
"""

import re
import sys

from ..options import options
from ..record import ROOT
from ..tables import KINDS, Figures
from ..tables.stored import Missing

PAGES = sorted((ROOT / "docs").rglob("*.md"))
BLOCK = re.compile(r"^(<!-- table: (\S+)(?: (\S+))? -->\n).*?^(<!-- end -->)$", re.DOTALL | re.MULTILINE)


def filled(text):
    """The text of a page with its tables written anew."""

    def block(match):
        start, name, of, end = match.groups()
        if name not in KINDS:
            raise Missing(f"no table {name!r}: there are {', '.join(sorted(KINDS))}")
        figures = Figures(of)
        table = KINDS[name](figures)
        return f"{start}\n{figures.source()}\n{table}\n{end}"

    return BLOCK.sub(block, text)


def add_arguments(parser):
    parser.add_argument(
        "--check",
        action="store_true",
        help="write nothing; list the pages that would change, and fail if there are any",
    )


def main():
    changed = []
    for page in PAGES:
        old = page.read_text(encoding="utf-8")
        try:
            new = filled(old)
        except Missing as missing:
            sys.exit(f"tables: error: {page.relative_to(ROOT)}: {missing}\nhint: scripts/lab.sh measures figures")
        if new != old:
            changed.append(str(page.relative_to(ROOT)))
            if not options.check:
                page.write_text(new, encoding="utf-8")
    if options.check and changed:
        sys.exit(
            f"tables: error: {', '.join(changed)}: tables differ from the stored figures\nhint: scripts/lab.sh tables"
        )
