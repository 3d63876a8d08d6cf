# shellcheck shell=bash
# Functions of the tests of packages, which source this file: they count checks, and test a program that a package has.

passed=0 failed=0 notes=()

# check NAME COMMAND...: counts a command that must succeed, and shows its output if it does not
check() {
    if "${@:2}" >check.log 2>&1; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        printf 'FAILED %s\n' "$1"
        cat check.log
    fi
}
# no COMMAND...: succeeds if the command fails
no() { ! "$@"; }
# says PATTERN COMMAND...: succeeds if the command does, and prints a line that matches
says() { "${@:2}" >said && cat said && grep -Eq -- "$1" said; }
# holds FILE...: succeeds if no file is missing or empty
holds() {
    local file
    for file; do [ -s "$file" ] || { echo "$file: missing or empty" && return 1; }; done
}
# limited COMMAND...: runs the command with a limit of 16 GiB, on systems that have one
limited() (
    ulimit -v $((16 << 20)) 2>/dev/null || true
    "$@"
)
# first_picture NAME START: notes the time since START, and keeps it in `first`
first_picture() {
    first=$((SECONDS - $2))
    notes+=("$(printf '%-8s %3d s from the download to the first picture' "$1" "$first")")
}
# report: prints the notes and the counts; succeeds if no check has failed
report() {
    [ ${#notes[@]} -eq 0 ] || printf '%s\n' "${notes[@]}"
    printf '%d passed, %d failed\n' "$passed" "$failed"
    [ "$failed" -eq 0 ]
}

# The scenes that a program of another system renders for a comparison with Linux's, and the size of their pictures.
compared=(pool gems prism cornell)
size=(--width 160 --iterations 8)

# test_program START DENOISER SCENES COMMAND...: tests a program in the current folder, with the scenes of its archive,
# which was extracted at START. It sets `picture`, the options of the compared pictures. With CAUSTIQUE_ONNXRUNTIME=none
# the program renders without networks.
test_program() {
    local scenes=$3 command=("${@:4}") small=(--width 32 --iterations 2 --progress none) name i
    # What guided light paths learn turns a hit that rounding changes into other light paths.
    picture=("${size[@]}" --guide off --seed 3 --denoise "$2" --strict --progress none --reproducible)

    check 'render' "${command[@]}" render "$scenes/pool.glb" -o pool.exr --png pool.png "${picture[@]}"
    first_picture archive "$1"
    check 'pictures' holds pool.exr pool.png
    for name in "${compared[@]:1}"; do
        check "render $name" "${command[@]}" render "$scenes/$name.glb" -o "$name.exr" "${picture[@]}"
    done
    check '--version' says '^caustique .*commit [0-9a-f]+' "${command[@]}" --version
    check 'info' says pool "${command[@]}" info "$scenes/pool.glb"
    check 'plan' says caustic "${command[@]}" plan "$scenes/pool.glb" --width 64
    [ "${CAUSTIQUE_ONNXRUNTIME:-}" = none ] ||
        check 'network' "${command[@]}" render "$scenes/pool.glb" -o net.exr --model compact "${small[@]}"
    for i in 0 1; do
        check "shard $i" "${command[@]}" render "$scenes/pool.glb" -o "shard$i.exr" --shard "$i/2" "${small[@]}"
    done
    check 'merge' "${command[@]}" merge shard0.exr shard1.exr -o merged.exr
    check 'a missing file is an error' no "${command[@]}" render missing.glb -o missing.exr
    test_kill
    test_decoder
    test_full_disk
}

# An animation that is killed leaves a claim and a checkpoint. The next run takes the frame, and ends with the same bytes.
test_kill() {
    cp "$ROOT/tests/cli/light/fade_in.gltf" animated.gltf
    local animation=(render animated.gltf --frames 1-2 --skip-existing --method vcm --width 64 --iterations 40 --seed 3
        --progress none --reproducible --checkpoint-every 0.001)
    "${command[@]}" "${animation[@]}" -o 'cut####.exr' >killed.log 2>&1 &
    for i in $(seq 6000); do [ ! -e cut0001.exr.checkpoint ] || break; sleep 0.05; done
    kill -9 $! || true
    wait $! 2>/dev/null || true
    check 'a killed render leaves a claim and a checkpoint' holds cut0001.exr.claim cut0001.exr.checkpoint
    check 'frames after a kill' "${command[@]}" "${animation[@]}" -o 'cut####.exr'
    check 'frames without a kill' "${command[@]}" "${animation[@]}" -o 'whole####.exr'
    for i in 1 2; do check "frame $i is the same" cmp "cut000$i.exr" "whole000$i.exr"; done
    check 'no claims and checkpoints are left' no compgen -G '*.c[lh]*'
}

# A decoder that aborts ends its own process alone. Wine does not limit the memory of a process.
test_decoder() {
    for name in sequential huge-table; do
        "${python:-python3}" -c 'import base64, json, sys
data = open(sys.argv[1], "rb").read()
draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": draco}
uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
print(json.dumps({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [primitive]}], "buffers": [{"byteLength": len(data), "uri": uri}],
    "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
    "accessors": [{"componentType": 5126, "type": "VEC3", "count": 4},
        {"componentType": 5125, "type": "SCALAR", "count": 6}]}))
' "$ROOT/tests/corpus/draco/$name" >"$name.gltf"
    done
    check 'a compressed mesh' says 'triangles +2' "${command[@]}" info sequential.gltf
    check 'a damaged mesh is an error' no limited "${command[@]}" info huge-table.gltf
    cp check.log damaged.log
    check 'its decoder aborts' says 'the decoder asks for more than' cat damaged.log
}

# On systems that can mount a small disk.
test_full_disk() {
    if [ "$(id -u)" -ne 0 ] || ! mkdir full || ! mount -t tmpfs -o size=16k caustique-full full 2>/dev/null; then
        return
    fi
    check 'a full disk is an error' \
        no "${command[@]}" render "$scenes/pool.glb" -o full/pool.exr --width 160 --iterations 1 --progress none
    cp check.log full.log
    check 'it says so' says 'os error (28|112)' cat full.log
    check 'and leaves no file' no compgen -G 'full/*'
    umount full
}

# compare_pictures SCENES COMMAND...: compares the pictures of test_program with those of Linux's program, and keeps the
# differences in `differences`, as pairs of JSON. They omit the worst 0.5 % of the pixels: rounding decides on which side
# of an edge a ray passes, and the facets of gems then send it elsewhere.
compare_pictures() {
    local name difference bytes
    differences=
    for name in "${compared[@]}"; do
        check "Linux: $name" "${@:2}" render "$1/$name.glb" -o "linux-$name.exr" "${picture[@]}"
        check "compare $name" "${@:2}" compare "$name.exr" "linux-$name.exr" --json
        difference=$(sed -n 's/^  "relmse_trimmed": \([^,]*\),*/\1/p' check.log)
        bytes='other bytes'
        ! cmp -s "$name.exr" "linux-$name.exr" || bytes='the same bytes'
        notes+=("$name: trimmed relMSE $difference from the picture of Linux on x86-64, $bytes")
        differences+="\"$name\": ${difference:-null}, "
        check "same picture: $name" python3 -c 'import sys; sys.exit(not float(sys.argv[1]) < 1e-6)' "${difference:-1}"
    done
    differences=${differences%, }
}
