"""Tables of the documentation from stored figures: KINDS has a function for each, by the name that stands in a page.

A function takes `Figures` and returns Markdown. What it asks `Figures` for stands above its table as the source.
"""

from . import accuracy, blender, comparisons, farms, finished, gallery, merits, rules, scaling, sizes, speed
from .figures import Figures

_ROOMS = (accuracy, blender, comparisons, farms, finished, gallery, merits, rules, scaling, sizes, speed)
KINDS = {name: table for room in _ROOMS for name, table in room.KINDS.items()}

__all__ = ["KINDS", "Figures"]
