"""Tables of the documentation from stored figures: KINDS has a function for each, by the name that stands in a page.

A function takes `Figures` and returns Markdown. What it asks `Figures` for stands above its table as the source.
"""

from . import comparisons, farms, finished, rules, speed
from .figures import Figures

KINDS = {**speed.KINDS, **rules.KINDS, **comparisons.KINDS, **finished.KINDS, **farms.KINDS}

__all__ = ["KINDS", "Figures"]
