"""Tables of the documentation from stored figures: KINDS has a function for each, by the name that stands in a page.

A function takes `Figures` and returns Markdown. What it asks `Figures` for stands above its table as the source.
"""

from . import (
    accuracy_tables,
    blender_tables,
    comparisons_tables,
    farms_tables,
    finished_tables,
    gallery_tables,
    merits_tables,
    rules_tables,
    scaling_tables,
    sizes_tables,
    speed_tables,
)
from .stored import Figures

_MODULES = (
    accuracy_tables,
    blender_tables,
    comparisons_tables,
    farms_tables,
    finished_tables,
    gallery_tables,
    merits_tables,
    rules_tables,
    scaling_tables,
    sizes_tables,
    speed_tables,
)
KINDS = {name: table for module in _MODULES for name, table in module.KINDS.items()}

__all__ = ["KINDS", "Figures"]
