"""Tables of the documentation from stored figures: KINDS has a function for each, by the name that stands in a page.

A function takes `Figures` and returns Markdown. What it asks `Figures` for stands above its table as the source.
"""

from . import blender, comparisons, finished, rules, sizes, speed
from .figures import Figures

KINDS = {**blender.KINDS, **sizes.KINDS, **speed.KINDS, **rules.KINDS, **comparisons.KINDS, **finished.KINDS}

__all__ = ["KINDS", "Figures"]
