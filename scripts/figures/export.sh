#!/usr/bin/env bash
# Export of scenes of 1,000 objects from Blender: whether they share meshes or each has its own.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
# shellcheck source=scripts/setup.sh
. scripts/setup.sh
setup test
exec .venv-bpy/bin/python scripts/figures/_export.py
