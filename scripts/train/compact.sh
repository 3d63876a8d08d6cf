#!/bin/sh
# Makes the shipped network from nothing: data, training, evaluation, export, fixture. Each step goes on where it stopped.
#   scripts/train/compact.sh FOLDER      (FOLDER takes the data and the checkpoints, some 60 MB)
set -eu
folder=$(mkdir -p "$1" && cd "$1" && pwd)
cd "$(dirname "$0")"
python=${PYTHON:-python3}
caustique=${CAUSTIQUE:-../../target/release/caustique}
threads=${THREADS:-1}
scenes=../../scenes
seen="$scenes/cornell.glb $scenes/torus.glb $scenes/pool.glb $scenes/interior.glb $scenes/stadium.glb $scenes/fog.glb"
data="$python data.py --caustique $caustique --threads $threads --width 128 --height 72 --side 0 -o $folder/data"

$data --variants 1 --renders 4 --iterations 4 8 16 64 --reference-iterations 160 $seen
# To evaluate with: two scenes that are never trained on, and two of the others from their own cameras.
$data --variants 0 --renders 2 --iterations 4 64 --reference-iterations 240 \
    $scenes/gems.glb $scenes/lamp.glb $scenes/cornell.glb $scenes/pool.glb
$data --variants 2 --renders 4 --iterations 4 16 32 8 --reference-iterations 160 $seen
[ -d "$folder/synthetic" ] || $python synthetic.py -o "$folder/synthetic" --count 240

# On one core; a loaded one did the steps that ../../src/combine/models/compact.txt tells in these minutes.
$python train.py --data "$folder/synthetic" --out "$folder/pre" --batch 4 --side 48 --rate 1e-3 --threads "$threads" --minutes 12
$python train.py --data "$folder/data" "$folder/synthetic" --init "$folder/pre/last.pt" --out "$folder/run" --squared 0.5 \
    --batch 4 --side 56 --rate 1e-3 --threads "$threads" --minutes 11
$python evaluate.py --checkpoint "$folder/run/last.pt" --data "$folder/data"
$python export.py --checkpoint "$folder/run/last.pt" -o ../../src/combine/models/compact.onnx
$python fixture.py --checkpoint "$folder/run/last.pt"
