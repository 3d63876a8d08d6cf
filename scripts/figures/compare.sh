#!/usr/bin/env bash
# The comparison scenes in caustique and in Mitsuba 3: ratios of means and of tiles. The last two lines hold what --correct is about:
# the scene of wide lobes with Mitsuba's own models, and with what they lack. Pictures of the differences land in out/compare.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
bash scripts/compare/setup.sh
python=.venv-compare/bin/python
folder=out/compare
"$python" scripts/compare/scenes.py "$folder"

# compare SCENE SPP [OPTION...]
compare() {
    local scene=$1 spp=$2 name
    shift 2
    name=$scene
    [ $# -eq 0 ] || name=$scene-corrected
    "$python" scripts/compare/mitsuba.py "$folder/$scene.glb" --width "${WIDTH:-160}" --seeds "${SEEDS:-8}" --spp "$spp" \
        --png "$folder/$name.png" --json "$@" >"$folder/$name.json"
    "$python" -c 'import json, sys; sys.path.append("scripts/compare"); import tiles; print(tiles.table(json.load(sys.stdin)))' \
        <"$folder/$name.json"
    "$python" scripts/figures/_store.py mitsuba <"$folder/$name.json"
}

compare glass 144
compare frosted 112 --correct
compare metal 40 --correct
compare textures 112 --correct
compare wide 40 --correct
compare wide 40
