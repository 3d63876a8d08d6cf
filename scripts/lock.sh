#!/usr/bin/env bash
# Pins what the requirement files (requirements-*.in, lab/train/requirements.in) name, and what that needs, by version and
# hash in files of the same names that end in .txt, which are installed. Needs uv (pip install uv).
#
#   scripts/lock.sh [NAME...]     some of them, such as test or lab/train/requirements

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

[ $# -gt 0 ] || set -- test python usd compare peers bpy farm deny lab/train/requirements
for name in "$@"; do
    case $name in
        */*) file=$name ;;
        *) file=requirements-$name ;;
    esac
    uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --annotation-style line \
        --custom-compile-command scripts/lock.sh "$file.in" -o "$file.txt"
done
