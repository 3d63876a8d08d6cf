"""Tables of the documentation from stored figures: KINDS has a function for each, by the table's name in a page.

A function takes `Figures` and returns Markdown. The figures that it uses are named above the table.
"""

import importlib
from pathlib import Path

from .stored import Figures

_MODULES = (
    importlib.import_module(f".{path.stem}", __name__) for path in sorted(Path(__file__).parent.glob("*_tables.py"))
)
KINDS = {name: table for module in _MODULES for name, table in module.KINDS.items()}

__all__ = ["KINDS", "Figures"]
