#!/usr/bin/env bash
# Tests the package for Windows under Debian's wine.
#
#   tests/wine.sh PACKAGES [PROGRAM]    PACKAGES is the folder with the zip of scripts/package.sh --target windows-x86_64;
#                                       PROGRAM renders the pictures to compare with, by default the one of the package
#                                       for Linux
#
# The last lines give the time to the first picture, the differences from Linux's pictures and the processor time relative
# to Linux's, and count the checks. With CAUSTIQUE_STORE=1 these figures are stored in scripts/lab/results.jsonl.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../scripts/setup.sh"

packages=$(cd "$1" && pwd)
native=$(realpath "${2:-$packages/build/x86_64-unknown-linux-gnu/release/caustique}")
[ -x "$native" ] || fail "$native is not there" "scripts/package.sh makes it; or name a program"
need_mingw
[ -x /usr/lib/wine/wine64 ] || apt_install wine64
work=$(mktemp -d)
export WINEPREFIX=$work/wine WINEDEBUG=-all
# Libraries that the environment names are Linux's.
wine() {
    env -u CAUSTIQUE_HOME -u CAUSTIQUE_EMBREE -u CAUSTIQUE_OIDN -u CAUSTIQUE_ONNXRUNTIME /usr/lib/wine/wine64 "$@"
}
trap '/usr/lib/wine/wineserver64 -k 2>/dev/null || true; rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=tests/checks.sh
. "$ROOT/tests/checks.sh"

say "preparing wine"
wine wineboot -i >/dev/null 2>&1
# Rust's standard library takes random numbers from a function that wine 8 lacks.
cat >prng.c <<'C'
#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T length)
{
    return SystemFunction036(data, (ULONG)length);
}
C
x86_64-w64-mingw32-gcc -shared -o "$WINEPREFIX/drive_c/windows/system32/bcryptprimitives.dll" prng.c -ladvapi32

start=$SECONDS
mkdir 'ein schöner Ort'
python3 -m zipfile -e "$packages"/caustique-*-windows-x86_64.zip 'ein schöner Ort'
home=$(echo "$work/ein schöner Ort"/caustique-*)
caustique() { wine "$home/bin/caustique.exe" "$@"; }
scenes=$home/share/caustique/scenes
picture=(--width 160 --iterations 8 --seed 3 --denoise oidn --strict --progress none --reproducible)
small=(--width 32 --iterations 2 --progress none)

check 'render' caustique render "$scenes/pool.glb" -o pool.exr --png pool.png "${picture[@]}"
first=$((SECONDS - start))
first_picture zip "$start"
check 'pictures' holds pool.exr pool.png
check '--version' says '^Embree 4.*lib.caustique.embree4.dll' caustique --version
for library in 'Embree ' 'ONNX Runtime ' 'Open Image Denoise '; do
    check "doctor: $library" says "^$library.*from package" caustique doctor
done
check 'info' says pool caustique info "$scenes/pool.glb"
check 'plan' says caustic caustique plan "$scenes/pool.glb"
for scene in "${compared[@]:1}"; do
    check "render $scene" caustique render "$scenes/$scene.glb" -o "$scene.exr" "${picture[@]}"
done
compare_pictures "$scenes" "$native"
for wheel in "$packages"/caustique-*-win_amd64.whl; do
    [ -e "$wheel" ] || continue
    python3 -m zipfile -e "$wheel" wheel
    x86_64-w64-mingw32-objdump -p wheel/caustique/_native.pyd >imports
    check 'the module needs Python' says 'DLL Name: python3\.dll' cat imports
    check 'and no library of the compiler' no says 'DLL Name: lib' cat imports
    check 'the program of the wheel' wine wheel/caustique/bin/caustique.exe info "$scenes/pool.glb"
    rm -r wheel
done
check 'network' caustique render "$scenes/pool.glb" -o net.exr --model compact "${small[@]}"
for i in 0 1; do check "shard $i" caustique render "$scenes/pool.glb" -o "shard$i.exr" --shard "$i/2" "${small[@]}"; done
check 'merge' caustique merge shard0.exr shard1.exr -o merged.exr
cp "$ROOT/tests/cli/light/fade_in.gltf" animated.gltf
animation=(animated.gltf --frames 1-2 --skip-existing)
check 'animation' caustique render "${animation[@]}" -o 'frame####.exr' "${small[@]}"
check 'frames' holds frame0001.exr frame0002.exr
check 'no claims are left' no compgen -G '*.claim'
# A process that is killed leaves a claim; the next one takes the frame.
wine "$home/bin/caustique.exe" render "${animation[@]}" -o 'long####.exr' --width 320 --time 600 --progress none \
    >killed.log 2>&1 &
for _ in $(seq 120); do [ ! -e long0001.exr.claim ] || break; sleep 0.5; done
check 'a claim while rendering' holds long0001.exr.claim
kill -9 $! || true
/usr/lib/wine/wineserver64 -k
wait 2>/dev/null || true
check 'frames after a kill' caustique render "${animation[@]}" -o 'long####.exr' "${small[@]}"
check 'their pictures' holds long0001.exr long0002.exr
check 'its claim is gone' no test -e long0001.exr.claim
# A decoder that aborts ends its own process alone. Wine does not limit its memory.
for name in sequential huge-table; do
    python3 -c 'import base64, json, sys
data = open(sys.argv[1], "rb").read()
draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": draco}
uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
print(json.dumps({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [primitive]}], "buffers": [{"byteLength": len(data), "uri": uri}],
    "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
    "accessors": [{"componentType": 5126, "type": "VEC3", "count": 4}, {"componentType": 5125, "type": "SCALAR", "count": 6}]}))
' "$ROOT/tests/corpus/draco/$name" >"$name.gltf"
done
limited() (ulimit -v $((16 << 20)) && caustique "$@")
check 'a compressed mesh' says 'triangles +2' caustique info sequential.gltf
check 'a damaged mesh is an error' no limited info huge-table.gltf
cp check.log damaged.log
check 'its decoder aborts' says 'the decoder asks for more than' cat damaged.log
check 'a missing file is an error' no caustique render missing.glb -o missing.exr
if [ "$(id -u)" -eq 0 ] && mkdir full && mount -t tmpfs -o size=64k caustique-full full 2>/dev/null; then
    check 'a full disk is an error' no caustique render "$scenes/pool.glb" -o full/pool.exr --width 640 --iterations 1 --progress none
    cp check.log full.log
    check 'it says so' says 'os error 112' cat full.log
    check 'and leaves no file' no compgen -G 'full/*'
    umount full
fi

# Processor time in pairs of runs, in which other programs of the machine slow both.
ratio=$(python3 - "$native" "$home/bin/caustique.exe" "$scenes/pool.glb" <<'PYTHON'
import os, resource, statistics, subprocess, sys

native, program, scene = sys.argv[1:]
words = ["render", scene, "--width", "320", "--iterations", "8", "--threads", "1", "--no-finish", "--progress", "none"]
environment = {name: value for name, value in os.environ.items() if not name.startswith("CAUSTIQUE_")}


def seconds(command, environment):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*command, *words, "-o", "timed.exr"], env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


pairs = [(seconds(["/usr/lib/wine/wine64", program], environment), seconds([native], os.environ)) for _ in range(5)]
print(f"{statistics.median(wine / linux for wine, linux in pairs):.3f}")
PYTHON
)
notes+=("$ratio times the processor time of Linux's program")
if [ -n "${CAUSTIQUE_STORE:-}" ]; then
    PYTHONPATH=$ROOT/scripts python3 -c 'import json, sys; from lab.record import record
record("windows", json.loads(sys.argv[1]))' "{\"first_picture_seconds\": $first, \"relmse\": {$differences},
        \"zip_mib\": $(($(stat -c %s "$packages"/caustique-*-windows-x86_64.zip) >> 20)), \"processor_time_ratio\": $ratio}"
fi
report
