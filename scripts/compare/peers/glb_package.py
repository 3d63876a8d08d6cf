"""The pure Python modules of the package, `glb` and `meshes`, without its native part."""

import importlib
import sys
import types
from pathlib import Path

_pure = types.ModuleType("pure")
_pure.__path__ = [str(Path(__file__).resolve().parents[3] / "ffi" / "python" / "caustique")]
sys.modules["pure"] = _pure
glb, meshes = (importlib.import_module(f"pure.{name}") for name in ("glb", "meshes"))
