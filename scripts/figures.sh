#!/usr/bin/env bash
# Measures: runs the scripts in scripts/figures, each of which prints a table and stores its figures with commit and
# machine in scripts/figures/results.jsonl (see record.py there).
#
#   scripts/figures.sh              what there is
#   scripts/figures.sh all          everything, one after the other
#   scripts/figures.sh NAME...      these
#
# Python scripts run in .venv (numpy, OpenEXR, flip-evaluator). CAUSTIQUE_BIN is the program.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
FIGURES=$ROOT/scripts/figures

# Every script there is a figure, except for the recorder and modules that figures share: _NAME.py.
names() {
    find "$FIGURES" -maxdepth 1 \( -name '*.sh' -o -name '*.py' \) ! -name 'record.py' ! -name '_*' -printf '%f\n' |
        sed 's/\.[a-z]*$//' | sort
}

if [ $# -eq 0 ]; then
    echo "figures: $(names | tr '\n' ' ')"
    echo "run: scripts/figures.sh all, or names"
    exit
fi
if [ "$1" = all ]; then
    mapfile -t chosen < <(names)
else
    chosen=("$@")
    for name in "${chosen[@]}"; do
        [[ $'\n'$(names)$'\n' == *$'\n'"$name"$'\n'* ]] || fail "no figure '$name'" "one of: $(names | tr '\n' ' ')"
    done
fi

setup python
cd "$ROOT"
cargo build --locked --release
CAUSTIQUE_BIN=$(realpath "${CARGO_TARGET_DIR:-target}/release/caustique")
export CAUSTIQUE_BIN

failures=()
for name in "${chosen[@]}"; do
    printf '\n== %s\n' "$name"
    if [ -f "$FIGURES/$name.sh" ]; then
        bash "$FIGURES/$name.sh" || failures+=("$name")
    else
        .venv/bin/python "$FIGURES/$name.py" || failures+=("$name")
    fi
done
[ ${#failures[@]} -eq 0 ] || fail "figures that failed: ${failures[*]}" "their output is above"
