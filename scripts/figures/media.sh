#!/usr/bin/env bash
# Media: path tracing, bidirectional path tracing and photon mapping on the scene of god rays for the same time each, against a longer render.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
exec "$([ -x .venv/bin/python ] && echo .venv/bin/python || echo python3)" scripts/figures/_media.py
