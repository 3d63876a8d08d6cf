"""Features of Blender's materials, a scene each, for `scripts/lab.sh torture`: FEATURES has them by name."""

from . import torture_coats, torture_mixes, torture_relief, torture_textures
from .torture_stage import FEATURES

#: The order of docs/lab/blender-table.md.
MODULES = (torture_coats, torture_mixes, torture_relief, torture_textures)
__all__ = ["FEATURES", "MODULES"]
