#!/usr/bin/env bash
# Finished pictures at equal time beside Mitsuba, LuxCore and Cycles, and the pictures of docs/gallery.md: see _gallery.py, which says what
# variables it takes. `scripts/compare/setup.sh peers` installs the others.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
exec .venv/bin/python scripts/figures/_gallery.py "$@"
