#!/usr/bin/env bash
# Builds the Python package and installs it.
#
#   scripts/python.sh          the wheel, into target/wheels, into .venv-python and, alone, into .venv-wheel
#
# The wheel holds neither Embree nor Open Image Denoise nor ONNX Runtime: they are found when they are needed, as the
# program finds them.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

setup wheel
cd "$ROOT"
wheels=$(realpath -m "${CARGO_TARGET_DIR:-target}/wheels")
rm -rf "$wheels"
# In the main build's profile and folder, so that what `cargo build --workspace` has compiled is not compiled again.
.venv-python/bin/maturin build --quiet --release --locked --manifest-path ffi/python/Cargo.toml --compatibility linux \
    --interpreter .venv-python/bin/python --out "$wheels"
# install VENV OPTIONS... : the wheel into an environment
install() { "$1/bin/python" -I -m pip install -q --disable-pip-version-check "${@:2}" "$wheels"/*.whl; }

install .venv-python --force-reinstall --no-deps
# With what the wheel asks for, and nothing else. It is kept, for a fresh one takes 20 seconds; the wheel in it is not.
[ -x .venv-wheel/bin/python ] || "$PYTHON" -I -m venv .venv-wheel
install .venv-wheel
install .venv-wheel --force-reinstall --no-deps
printf '%s\n' "$wheels"/*.whl
