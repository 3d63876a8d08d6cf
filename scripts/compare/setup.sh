#!/usr/bin/env bash
# Makes .venv-compare, in which scripts/compare/mitsuba.py runs, and installs the LLVM that Mitsuba's vectorised variant
# loads. Runs again in a second when nothing is missing. Without an LLVM the comparison takes Mitsuba's scalar variant.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../setup.sh"

# LLVM 14 and 15 cannot compile all that Mitsuba 3.9 asks for.
find_llvm() {
    [ -z "${DRJIT_LIBLLVM_PATH:-}" ] || return 0
    "$PYTHON" -c 'import glob, re, sys
names = [path.rsplit("/", 1)[1] for path in glob.glob("/usr/lib/*-linux-gnu/libLLVM*.so*")]
sys.exit(not any(int(n) >= 16 for name in names for n in re.findall("[0-9]+", name)[:1]))'
}

need_llvm() {
    local package
    find_llvm && return
    apt_update
    package=$(apt-cache pkgnames libllvm | grep -E '^libllvm[0-9]+$' | sort -V | tail -n 1 || true)
    if [ -z "$package" ]; then
        say "apt has no LLVM: Mitsuba renders with its slow scalar variant"
        return
    fi
    apt_install "$package"
}

need_python
need_llvm
need_venv_module
need_venv .venv-compare "$PYTHON" requirements-compare.txt
