#!/usr/bin/env python3
"""Writes the tables of docs/ from scripts/figures/results.jsonl: what stands between a line `<!-- table: NAME -->`, or
`<!-- table: NAME SET -->` where figures have sets, and the next `<!-- end -->`. Commit, date and machine stand above
each table. scripts/figure_tables has the tables by name.

  scripts/tables.py           writes
  scripts/tables.py --check   says which pages would change, and fails if any would
"""

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# What figures and their tables share.
sys.path.append(str(ROOT / "scripts" / "figures"))

from figure_tables import KINDS, Figures  # noqa: E402
from figure_tables.figures import Missing  # noqa: E402

PAGES = sorted((ROOT / "docs").glob("*.md"))
BLOCK = re.compile(r"^(<!-- table: (\S+)(?: (\S+))? -->\n).*?^(<!-- end -->)$", re.DOTALL | re.MULTILINE)


def filled(text):
    """A page with its tables made again."""

    def block(match):
        start, name, of, end = match.groups()
        if name not in KINDS:
            raise Missing(f"no table {name!r}: there are {', '.join(sorted(KINDS))}")
        figures = Figures(of)
        table = KINDS[name](figures)
        return f"{start}\n{figures.source()}\n{table}\n{end}"

    return BLOCK.sub(block, text)


def main():
    parser = argparse.ArgumentParser(description="Writes the tables of docs/ from stored figures.")
    parser.add_argument("--check", action="store_true", help="fail where a table is not what is stored")
    arguments = parser.parse_args()
    changed = []
    for page in PAGES:
        old = page.read_text(encoding="utf-8")
        try:
            new = filled(old)
        except Missing as missing:
            sys.exit(f"tables: error: {page.relative_to(ROOT)}: {missing}\nhint: scripts/figures.sh measures figures")
        if new != old:
            changed.append(str(page.relative_to(ROOT)))
            if not arguments.check:
                page.write_text(new, encoding="utf-8")
    if arguments.check and changed:
        sys.exit(f"tables: error: {', '.join(changed)}: not as the stored figures say\nhint: scripts/tables.py")


if __name__ == "__main__":
    main()
