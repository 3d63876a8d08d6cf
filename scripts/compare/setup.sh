#!/usr/bin/env bash
# Installs other renderers for comparisons. If nothing is missing, it takes a second.
#
#   scripts/compare/setup.sh          Mitsuba in .venv-compare, for scripts/compare/mitsuba.py
#   scripts/compare/setup.sh peers    Mitsuba, LuxCore and Intel OIDN in .venv-peers, Cycles in .venv-bpy (as
#                                     scripts/setup.sh test makes it), for `caustique converge --with` and
#                                     scripts/lab.sh finished
#
# Both also install LLVM for Mitsuba's vectorised variant. Without LLVM Mitsuba uses its scalar variant, which is a
# third as fast.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../setup.sh"

# LLVM 15 and 16 abort on kernels of Mitsuba 3.9 (scripts/compare/peers/variant.py).
llvm_is_new() { at_least 17 "$1"; }

find_llvm() {
    [ -z "${DRJIT_LIBLLVM_PATH:-}" ] || return 0
    local version
    local files
    files=$(find /usr/lib -name 'libLLVM*.so*' 2>/dev/null)
    for version in $(printf '%s\n' "$files" | sed -n 's/.*libLLVM[-.a-z]*\([0-9][0-9]*\).*/\1/p'); do
        if llvm_is_new "$version"; then return; fi
    done
    return 1
}

need_llvm() {
    local package
    find_llvm && return
    apt_update
    package=$(apt-cache pkgnames libllvm | grep -E '^libllvm[0-9]+$' | sort -V | tail -n 1 || true)
    if [ -n "$package" ] && llvm_is_new "${package#libllvm}"; then
        apt_install "$package"
    else
        say "apt has no LLVM of 17 or later: Mitsuba renders with its slow scalar variant"
    fi
}

# Blender's module lacks OpenEXR, which goes to a separate folder, so that .venv-bpy stays as scripts/setup.sh makes it.
need_exr_for_bpy() {
    local directory=$ROOT/.venv-peers/bpy requirement stamp
    requirement=$(awk '/^[^ #]/ { wanted = /^openexr==/ } wanted' "$ROOT/scripts/requirements-peers.txt")
    stamp="$("$ROOT/.venv-bpy/bin/python" --version) $requirement"
    [ "$(cat "$directory/.complete" 2>/dev/null)" != "$stamp" ] || return 0
    say "installing OpenEXR beside Blender's module"
    rm -rf "$directory"
    "$ROOT/.venv-bpy/bin/python" -I -m pip install -q --disable-pip-version-check --no-deps --target "$directory" \
        --require-hashes -r <(printf '%s\n' "$requirement") >&2 ||
        fail "pip could not install OpenEXR" "check the network and the disk, then run this script again"
    printf '%s\n' "$stamp" >"$directory/.complete"
}

case ${1:-mitsuba} in
mitsuba | peers) ;;
*) fail "unknown mode '$1'" "'peers', or nothing for Mitsuba alone" ;;
esac
need_python
need_llvm
need_venv_module
if [ "${1:-mitsuba}" = mitsuba ]; then
    need_venv .venv-compare "$PYTHON" requirements-compare.txt
else
    need_venv .venv-peers "$PYTHON" requirements-peers.txt
    need_bpy
    need_exr_for_bpy
fi
