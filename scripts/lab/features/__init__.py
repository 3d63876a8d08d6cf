"""Features of Blender's materials and scenes for `scripts/lab.sh torture`: one scene each, in FEATURES by name."""

from . import (
    torture_coats,
    torture_glass,
    torture_mixes,
    torture_relief,
    torture_scenes,
    torture_textures,
    torture_volumes,
)
from .torture_stage import FEATURES

#: In the order of docs/lab/blender-table.md.
MODULES = (
    torture_coats,
    torture_relief,
    torture_glass,
    torture_mixes,
    torture_textures,
    torture_scenes,
    torture_volumes,
)
__all__ = ["FEATURES", "MODULES"]
