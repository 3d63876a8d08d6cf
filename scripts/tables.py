#!/usr/bin/env python3
"""Writes the tables of docs/measurements.md from scripts/figures/results.jsonl: what stands between a line
`<!-- table: NAME SET -->` and the next `<!-- end -->`. One date, commit and machine stand above each table.

  scripts/tables.py           writes
  scripts/tables.py --check   says which would change, and fails if any would
"""

import argparse
import json
import math
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "measurements.md"
RESULTS = ROOT / "scripts" / "figures" / "results.jsonl"
BLOCK = re.compile(r"(<!-- table: (\S+) (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


def stored(name, of, file=RESULTS):
    """The last figure of a name and a set of scenes."""
    rows = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    found = [row for row in rows if row["name"] == name and row["values"].get("set") == of]
    if not found:
        sys.exit(f"tables: error: no figure {name!r} of the set {of!r} is stored\nhint: scripts/figures.sh {name}")
    return found[-1]


def source(row):
    """Where a table comes from."""
    machine = row["machine"]
    return (
        f"Commit {row['commit'][:10]}, {row['date'][:10]}, {machine['cores']} cores of {machine['cpu']},\n"
        f"{machine['memory_gib']:g} GiB, {machine['system']}.\n"
    )


def digits(value):
    return f"{value:.2g}" if value is not None else "-"


def finished(row):
    """Trimmed relMSE of delivered pictures by scene and method, the peers' with OIDN, and auto over the best other."""
    values = row["values"]
    trimmed = values["figures"].index("relmse_trimmed")
    cells = values["cells"]
    ours = list(dict.fromkeys(method for cell in cells for method in cell["ours"]))
    peers = list(dict.fromkeys(peer for cell in cells for peer in cell["peers"]))
    lines = [
        f"| scene, {cells[0]['budget']:g} s | " + " | ".join([f"`{name}`" for name in ours] + peers + ["auto / best"]) + " |",
        "| --- |" + " --- |" * (len(ours) + len(peers) + 1),
    ]
    ratios = []
    for cell in cells:
        mine = [cell["ours"].get(name, {}).get("delivered") for name in ours]
        theirs = [cell["peers"].get(name, {}).get("oidn") for name in peers]
        errors = {name: of[trimmed] for name, of in zip(ours, mine) if of}
        others = [error for name, error in errors.items() if name != "auto"]
        ratio = errors["auto"] / min(others) if "auto" in errors and others else None
        ratios += [ratio] if ratio else []
        shown = [of[trimmed] if of else None for of in mine + theirs] + [ratio]
        lines.append(f"| {cell['scene'].split('/')[-1]} | " + " | ".join(map(digits, shown)) + " |")
    text = "\n".join(lines) + "\n"
    if ratios:
        mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
        within = sum(ratio <= 1.1 for ratio in ratios)
        text += (
            f"\n`auto` over the best other method: geometric mean {mean:.2f}, worst {max(ratios):.2f}, within 1.1 on\n"
            f"{within} of {len(ratios)}.\n"
        )
    return text


KINDS = {"finished": finished}


def filled(text):
    """The document with its tables made again."""

    def block(match):
        start, name, of, end = match.groups()
        row = stored(name, of)
        return f"{start}\n{source(row)}\n{KINDS[name](row)}\n{end}"

    return BLOCK.sub(block, text)


def main():
    parser = argparse.ArgumentParser(description="Writes the tables of docs/measurements.md from stored figures.")
    parser.add_argument("--check", action="store_true", help="fail where a table is not what is stored")
    arguments = parser.parse_args()
    old = DOCUMENT.read_text(encoding="utf-8")
    new = filled(old)
    if not arguments.check:
        DOCUMENT.write_text(new, encoding="utf-8")
    elif new != old:
        sys.exit("tables: error: docs/measurements.md differs from the stored figures\nhint: scripts/tables.py")


if __name__ == "__main__":
    main()
