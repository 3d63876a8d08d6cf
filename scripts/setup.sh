#!/usr/bin/env bash
# Installs missing dependencies on Debian (12, 13, and derivatives with apt).
#
#   scripts/setup.sh render    for building and rendering: Rust (checked), a C linker, Embree, ONNX Runtime, and Open
#                              Image Denoise if available
#   scripts/setup.sh python    render, and the Python packages of the tests in .venv
#   scripts/setup.sh wheel     render, and packages to build and test the Python package in .venv-python
#   scripts/setup.sh package   a linker, and packages that build portable packages in .venv-package
#   scripts/setup.sh usd       render, and packages to read USD stages in .venv-usd
#   scripts/setup.sh bpy       Blender as a Python module in .venv-bpy, for scripts/blender without an installed Blender
#   scripts/setup.sh test      python, wheel and usd, and Blender as a Python module in .venv-bpy, .venv-bpy-oldest and
#                              .venv-bpy-newest
#   scripts/setup.sh farm      python, and packages of scripts/farm in .venv-farm: Ray, Open Job Description
#   scripts/setup.sh train     python, and packages to train the combiner in .venv-train: PyTorch (6 GB)
#
# Other scripts source this file and call `setup MODE`. If nothing is missing, it takes a second.
# CAUSTIQUE_EMBREE, CAUSTIQUE_ONNXRUNTIME and CAUSTIQUE_OIDN name libraries to use instead; CAUSTIQUE_PYTHON names a
# Python.

set -euo pipefail

# Every Python runs isolated (-I), because modules in the current folder may come from an untrusted source.
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# A program built in another folder finds the dependencies in this one.
export CAUSTIQUE_HOME=$ROOT

# Libraries that Blender's module links to and a minimal system lacks.
BPY_LIBRARIES=(libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1)

# Folders of Python modules that import each other by name; scripts/lab and tests/hard import from all of them.
MODULES=$ROOT/scripts/blender:$ROOT/scripts/compare/peers:$ROOT/scripts/farm

say() { printf 'setup: %s\n' "$*" >&2; }

# fail FAULT HINT
fail() {
    printf 'setup: error: %s\nhint: %s\n' "$1" "$2" >&2
    exit 1
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "not root, and there is no sudo to run: $*" "run it as root, then run this script again"
    fi
}

# Package lists are fetched once per run, before their first use.
apt_updated=
apt_update() {
    [ -z "$apt_updated" ] || return 0
    command -v apt-get >/dev/null ||
        fail "something is missing and this system has no apt-get to install it" \
            "install by hand: a C compiler, Embree 4 or 3, ONNX Runtime 1.17 or newer, Python 3 with venv"
    as_root apt-get update -qq >&2 ||
        fail "apt-get update failed" "check the network and /etc/apt/sources.list, then run this script again"
    apt_updated=1
}

# apt_install PACKAGE...
apt_install() {
    apt_update
    say "installing $*"
    # `env`, because sudo drops the caller's variables. The log is shown only after a failure.
    local log
    log=$(mktemp)
    if ! as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "$@" >"$log" 2>&1; then
        tail -n 20 "$log" >&2
        rm -f "$log"
        fail "apt-get could not install: $*" "the lines above say why; install these packages, then run this script again"
    fi
    rm -f "$log"
}

# apt_has PACKAGE: whether apt could install it
apt_has() {
    apt_update
    # No `grep -q` behind a pipe in these scripts: it exits early, the writer dies of SIGPIPE, and pipefail reports
    # that.
    [ -n "$(LC_ALL=C apt-cache policy "$1" 2>/dev/null | sed -n '/Candidate: [^(]/p')" ]
}

need_python() {
    PYTHON=${CAUSTIQUE_PYTHON:-python3}
    if ! command -v "$PYTHON" >/dev/null; then
        [ -z "${CAUSTIQUE_PYTHON:-}" ] || fail "CAUSTIQUE_PYTHON=$CAUSTIQUE_PYTHON is not there" "name a Python 3 or unset it"
        apt_install python3
    fi
}

# at_least OLDEST VERSION: compares dotted numbers
at_least() { [ "$(printf '%s\n%s\n' "$1" "$2" | sort -V | head -n 1)" = "$1" ]; }

need_rust() {
    local oldest version
    oldest=$(sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' "$ROOT/Cargo.toml" | head -n 1)
    if ! command -v cargo >/dev/null && [ -x "${CARGO_HOME:-$HOME/.cargo}/bin/cargo" ]; then
        PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
        export PATH
    fi
    if ! command -v cargo >/dev/null || ! command -v rustc >/dev/null; then
        fail "no Rust toolchain (cargo, rustc) found" "install Rust $oldest or newer with rustup: https://rustup.rs"
    fi
    version=$(cd "$ROOT" && rustc --version) ||
        fail "rustc does not run" "repair the toolchain: 'rustup toolchain install stable'"
    version=$(printf '%s\n' "$version" | sed 's/^rustc \([0-9.]*\).*/\1/')
    at_least "$oldest" "$version" ||
        fail "Rust $version is too old, $oldest is needed" \
            "run 'rustup update stable'; where Rust came from apt, install rustup: https://rustup.rs"
}

# has_target TRIPLE: whether Rust can build for another system, if need be after fetching its standard library
has_target() {
    [ -d "$(rustc --print target-libdir --target "$1")" ] || rustup -q target add "$1" 2>/dev/null
}

# need_target TRIPLE
need_target() {
    has_target "$1" || fail "there is no standard library of Rust for $1" "run 'rustup target add $1'"
}

# need_mingw: the compiler and the linker for Windows
need_mingw() {
    command -v x86_64-w64-mingw32-g++ >/dev/null || apt_install g++-mingw-w64-x86-64-posix mingw-w64-x86-64-dev
}

links() { printf 'int main(void) { return 0; }\n' | cc -x c -o /dev/null - -lm 2>/dev/null; }

need_linker() {
    links || apt_install gcc libc6-dev
    links || fail "cc cannot link a C program" "reinstall gcc and libc6-dev"
}

# loads LIBRARY: whether dlopen, which the program uses, loads it
loads() { "$PYTHON" -I -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1" 2>/dev/null; }

find_embree() {
    local library
    for library in "${CAUSTIQUE_EMBREE:-libembree4.so.4}" "${CAUSTIQUE_EMBREE:-libembree3.so.3}"; do
        if loads "$library"; then
            EMBREE=$library
            return
        fi
    done
    return 1
}

need_embree() {
    local package
    find_embree && return
    [ -z "${CAUSTIQUE_EMBREE:-}" ] ||
        fail "CAUSTIQUE_EMBREE=$CAUSTIQUE_EMBREE does not load" "name a file that is Embree 3 or 4, or unset it"
    for package in libembree4-4 libembree3-3; do
        if apt_has "$package"; then
            apt_install "$package"
            break
        fi
    done
    find_embree || fail "no Embree 4 or 3 found, and apt has no libembree4-4 or libembree3-3" \
        "install Embree 4 and set CAUSTIQUE_EMBREE to its libembree4.so.4"
}

# Installs pip with no system package other than python3-venv.
need_venv_module() {
    "$PYTHON" -I -c 'import ensurepip, venv' 2>/dev/null && return
    [ -z "${CAUSTIQUE_PYTHON:-}" ] || fail "$PYTHON has no venv module" "install it, or unset CAUSTIQUE_PYTHON"
    apt_install python3-venv
    "$PYTHON" -I -c 'import ensurepip, venv' 2>/dev/null ||
        fail "$(command -v "$PYTHON") has no venv module" "set CAUSTIQUE_PYTHON=/usr/bin/python3"
}

# find_library NAME: prints version and path
find_library() { "$PYTHON" "$ROOT/scripts/setup_library.py" "$1"; }

# download_wheel NAME VENV FOLDER [OPTION...]: the wheel that requirements-NAME.txt lists, by the pip of a virtual
# environment with more options. The libraries in the wheels do not depend on the Python version; naming a version makes
# pip accept the wheel with any.
download_wheel() {
    "$2/bin/python" -I -m pip download -q --disable-pip-version-check --no-deps --only-binary=:all: \
        --require-hashes --python-version 3.11 "${@:4}" -d "$3" -r "$ROOT/scripts/requirements-$1.txt" >&2
}

# fetch_library NAME TEMPORARY
fetch_library() {
    "$PYTHON" -I -m venv "$2/venv" &&
        download_wheel "$1" "$2/venv" "$2" &&
        "$PYTHON" "$ROOT/scripts/setup_library.py" "$1" unpack "$2"/*.whl >/dev/null
}

# unpack_library NAME: from its Python wheel into .deps
unpack_library() {
    local temporary status=0
    need_venv_module
    temporary=$(mktemp -d)
    fetch_library "$1" "$temporary" || status=1
    rm -rf "$temporary"
    return "$status"
}

find_onnxruntime() { ONNXRUNTIME=$(find_library onnxruntime); }

need_onnxruntime() {
    local package
    find_onnxruntime && return
    [ -z "${CAUSTIQUE_ONNXRUNTIME:-}" ] ||
        fail "CAUSTIQUE_ONNXRUNTIME=$CAUSTIQUE_ONNXRUNTIME is no ONNX Runtime 1.17 or newer" "name its libonnxruntime.so, or unset it"
    apt_update
    package=$(apt-cache pkgnames libonnxruntime1. | grep -E '^libonnxruntime1\.[0-9]+$' | sort -V | tail -n 1 || true)
    if [ -n "$package" ] && at_least libonnxruntime1.17 "$package"; then
        apt_install "$package"
    else
        say "unpacking ONNX Runtime from its Python wheel into .deps/onnxruntime"
        unpack_library onnxruntime ||
            fail "pip could not fetch ONNX Runtime" \
                "check the network, or install it and set CAUSTIQUE_ONNXRUNTIME to libonnxruntime.so"
    fi
    find_onnxruntime || fail "the installed ONNX Runtime does not load" "set CAUSTIQUE_ONNXRUNTIME to a working libonnxruntime.so"
}

find_oidn() { OIDN=$(find_library oidn); }

# Rendering works without this library, so only a library that the user named must load.
need_oidn() {
    find_oidn && return
    [ -z "${CAUSTIQUE_OIDN:-}" ] ||
        fail "CAUSTIQUE_OIDN=$CAUSTIQUE_OIDN is no Open Image Denoise 2" "name its libOpenImageDenoise.so, or unset it"
    say "unpacking Open Image Denoise from a Python wheel into .deps/oidn"
    # In a subshell, because a failure would end this shell.
    if ! (unpack_library oidn) || ! find_oidn; then
        OIDN=none
        say "warning: Open Image Denoise could not be had here; rendering does without." \
            "Where you have it, set CAUSTIQUE_OIDN to libOpenImageDenoise.so"
    fi
}

# need_venv DIRECTORY PYTHON REQUIREMENTS: a virtual environment with exactly these requirements (scripts/lock.sh)
need_venv() {
    local directory=$ROOT/$1 python=$2 requirements=$ROOT/scripts/$3 stamp
    stamp="$("$python" --version) $(sha256sum <"$requirements")"
    if [ "$(cat "$directory/.complete" 2>/dev/null)" = "$stamp" ] && "$directory/bin/python" -I -c '' 2>/dev/null; then
        return
    fi
    say "making $1 from $3"
    "$python" -I -m venv --clear "$directory" ||
        fail "$python could not make the virtual environment $1" "check that the disk has room"
    # Python compiles the few modules that it imports; compiling all of them takes minutes.
    "$directory/bin/python" -I -m pip install -q --no-compile --disable-pip-version-check --require-hashes \
        -r "$requirements" >&2 ||
        fail "pip could not install what scripts/$3 lists" "check the network and the disk, then run this script again"
    printf '%s\n' "$stamp" >"$directory/.complete"
}

# python_of VERSION...: prints a Python of one of these versions that can make virtual environments
python_of() {
    local python
    for python in "$PYTHON" python3.13 python3.11; do
        if "$python" -I -c 'import sys, venv, ensurepip
sys.exit("{}.{}".format(*sys.version_info) not in sys.argv[1:])' "$@" 2>/dev/null; then
            printf '%s\n' "$python"
            return
        fi
    done
    return 1
}

# Blender's module exists for some Python versions only.
find_bpy_python() {
    BPY_PYTHON=$(python_of 3.11 3.13) || fail "Blender's Python module needs Python 3.11 or 3.13 with venv, and neither is here" \
        "install one of them and set CAUSTIQUE_PYTHON to it"
}

missing_libraries() { LC_ALL=C ldd "$1" | sed -n 's/^[[:space:]]*\([^ ]*\) => not found.*/\1/p'; }

need_bpy() {
    find_bpy_python
    need_blender .venv-bpy "$BPY_PYTHON" requirements-bpy.txt
}

# The oldest supported Blender exists for Python 3.11 alone; the newest one depends on the Python.
need_other_bpy() {
    local python
    if python=$(python_of 3.11); then
        need_blender .venv-bpy-oldest "$python" requirements-bpy-oldest.txt
    fi
    python=$(python_of 3.13 || python_of 3.11)
    need_blender .venv-bpy-newest "$python" requirements-bpy-newest.txt
}

# need_blender DIRECTORY PYTHON REQUIREMENTS: Blender as a Python module, and the libraries that it links to
need_blender() {
    need_venv "$@"
    # ldd names all missing libraries; importing the module would start Blender and stop at the first.
    local module
    for module in "$ROOT/$1"/lib/python3*/site-packages/bpy/__init__*.so; do :; done
    [ -f "$module" ] || fail "$module is not there" "remove $1, then run this script again"
    [ -z "$(missing_libraries "$module")" ] || apt_install "${BPY_LIBRARIES[@]}"
    [ -z "$(missing_libraries "$module")" ] ||
        fail "Blender's Python module lacks libraries: $(missing_libraries "$module")" "install the packages that hold them"
}

# setup render|python|wheel|package|usd|bpy|test|farm|train
setup() {
    case $1 in
    render | python | wheel | package | usd | bpy | test | farm | train) ;;
    *) fail "unknown mode '$1'" "one of: render python wheel package usd bpy test farm train" ;;
    esac
    if [ "$1" = bpy ]; then
        need_python
        need_venv_module
        need_bpy
        return
    fi
    need_rust
    need_linker
    need_python
    if [ "$1" = package ]; then
        need_venv_module
        need_venv .venv-package "$PYTHON" requirements-package.txt
        return
    fi
    need_embree
    need_onnxruntime
    need_oidn
    say "Embree: $EMBREE; ONNX Runtime: $ONNXRUNTIME; Open Image Denoise: $OIDN"
    [ "$1" != render ] || return 0
    need_venv_module
    case $1 in wheel | test) need_venv .venv-python "$PYTHON" requirements-python.txt ;; esac
    [ "$1" != wheel ] || return 0
    case $1 in usd | test) need_venv .venv-usd "$PYTHON" requirements-usd.txt ;; esac
    [ "$1" != usd ] || return 0
    need_venv .venv "$PYTHON" requirements-test.txt
    case $1 in
    test)
        need_bpy
        need_other_bpy
        ;;
    farm) need_venv .venv-farm "$PYTHON" requirements-farm.txt ;;
    train) need_venv .venv-train "$PYTHON" lab/train/requirements.txt ;;
    esac
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then
    setup "${1:-render}"
fi
