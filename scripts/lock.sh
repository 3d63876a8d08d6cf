#!/usr/bin/env bash
# Pins the packages of requirements-*.in and lab/train/requirements.in, with their dependencies, by version and hash in
# the .txt files beside them, which setup.sh installs. Needs uv (pip install uv).
#
#   scripts/lock.sh [NAME...]     only these files, such as test or lab/train/requirements

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

[ $# -gt 0 ] || set -- test python package usd compare peers bpy bpy-oldest bpy-newest farm deny lab/train/requirements
for name in "$@"; do
    case $name in
        */*) file=$name ;;
        *) file=requirements-$name ;;
    esac
    uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --annotation-style line \
        --custom-compile-command scripts/lock.sh "$file.in" -o "$file.txt"
done
