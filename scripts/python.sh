#!/usr/bin/env bash
# Builds the Python package and installs it.
#
#   scripts/python.sh          the wheel, into target/wheels, into .venv-python and, alone, into .venv-wheel
#
# The wheel contains the program, for the command `caustique`, but no Embree, Open Image Denoise or ONNX Runtime: the
# package and the program find them at run time.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

setup wheel
cd "$ROOT"
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
wheels=$target/wheels
rm -rf "$wheels"
# maturin packs all files of the package's folder.
cargo build --quiet --locked --release --workspace
program=ffi/python/caustique/bin
trap 'rm -rf "$program"' EXIT
mkdir -p "$program"
cp "$target/release/caustique" "$program/"
# In the profile and folder of `cargo build --workspace`, whose compiled crates are reused.
.venv-python/bin/maturin build --quiet --release --locked --manifest-path ffi/python/Cargo.toml --compatibility linux \
    --interpreter .venv-python/bin/python --out "$wheels"
# install VENV OPTIONS... : the wheel into an environment
install() { "$1/bin/python" -I -m pip install -q --disable-pip-version-check "${@:2}" "$wheels"/*.whl; }

install .venv-python --force-reinstall --no-deps
# An environment with the wheel's dependencies alone. It is kept, because creating it takes 20 s; the wheel is
# reinstalled.
[ -x .venv-wheel/bin/python ] || "$PYTHON" -I -m venv .venv-wheel
install .venv-wheel
install .venv-wheel --force-reinstall --no-deps
printf '%s\n' "$wheels"/*.whl
