#!/usr/bin/env bash
# A linker for `rustc -C linker=`: links as ever, and then LAYOUTS more programs beside the first, OUTPUT-1, OUTPUT-2 ..., whose functions follow one another in orders drawn
# at random (lld). What a program takes hangs on which of its functions share lines of the caches, some percent of it, and that on what the linker happens to do
# [Mytkowicz et al. 2009]; over many orders it is a mean with an error.
set -euo pipefail
cc "$@"
output=
last=
for argument in "$@"; do
    [ "$last" != -o ] || output=$argument
    last=$argument
done
for ((layout = 1; layout <= LAYOUTS; layout++)); do
    cc "$@" -o "$output-$layout" -Wl,--strip-debug "-Wl,--shuffle-sections=.text*=$layout"
done
