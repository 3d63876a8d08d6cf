#!/usr/bin/env bash
# Runs the demo and the tests on bare Debian systems made by debootstrap, as a stranger would: git, Python 3 and a Rust
# toolchain, nothing else. Needs root, debootstrap, unshare and this machine's Rust toolchain.
#
#   tests/bare.sh [12|13|both] [--dir DIR] [--only demo|test|setup|package|blender] [--keep]
#
# `package` tests the packages in target/package (scripts/package.sh) by tests/package.sh, without Rust; `blender`, on
# Debian 13, the extension there by tests/extension.sh. The last commit is tested, not the working tree. DIR (default /var/tmp/caustique-bare) holds
#   root-12, root-13    the bare systems, made once and never written to again
#   run-12, run-13      the copies that the scripts run in, made anew each time, removed afterwards (kept with --keep)
#   cache               downloads of pip and cargo, shared by the runs
#   demo-12.log ...     what the scripts said
# All mounts live in a mount namespace of their own and end with it, whatever happens: nothing is ever removed through
# a mount.

set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
DIR=/var/tmp/caustique-bare
RELEASES=(12 13)
PARTS=(demo test)
KEEP=

fail() {
    printf 'bare: error: %s\nhint: %s\n' "$1" "$2" >&2
    exit 1
}
say() { printf 'bare: %s\n' "$*" >&2; }

# --- inside the namespace: mounts, then the part within the root --------------------------------------------------------

# inside RELEASE PART DIR SYSROOT
inside() {
    local DIR=$3 SYSROOT=$4
    local run=$DIR/run-$1 script status=0 needed=()
    mount -t proc proc "$run/proc"
    mount --rbind /dev "$run/dev"
    mkdir -p "$run/opt/rust" "$run/root/.cache/pip" "$run/root/.cargo/registry"
    if [ "$2" != package ] && [ "$2" != blender ]; then
        mount --bind "$SYSROOT" "$run/opt/rust"
        mount -o remount,bind,ro "$run/opt/rust"
    fi
    mount --bind "$DIR/cache/pip" "$run/root/.cache/pip"
    mount --bind "$DIR/cache/registry" "$run/root/.cargo/registry"

    # Variables that this machine needs to reach its registries, and nothing else of its environment.
    local variables=(HOME=/root LANG=C.UTF-8 "TERM=${TERM:-dumb}" SHELL=/bin/bash
        PATH=/opt/rust/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
    local name
    for name in http_proxy https_proxy all_proxy no_proxy HTTP_PROXY HTTPS_PROXY ALL_PROXY NO_PROXY \
        SSL_CERT_FILE SSL_CERT_DIR PIP_CERT PIP_INDEX_URL PIP_EXTRA_INDEX_URL PIP_TRUSTED_HOST PIP_DEFAULT_TIMEOUT \
        CARGO_HTTP_CAINFO CARGO_HTTP_PROXY CARGO_NET_RETRY; do
        [ -z "${!name:-}" ] || variables+=("$name=${!name}")
    done
    case $2 in
        demo) script=./scripts/demo.sh ;;
        test) script=./scripts/test.sh ;;
        setup) script='./scripts/setup.sh test' ;;
        package) needed=(python3-venv) script='./tests/package.sh /packages' ;;
        blender)
            needed=(blender python3-numpy xvfb xauth libgl1-mesa-dri) script='./tests/extension.sh /packages'
            ;;
    esac
    [ ${#needed[@]} -eq 0 ] || env -i "${variables[@]}" DEBIAN_FRONTEND=noninteractive chroot "$run" /bin/sh -c \
        'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' sh "${needed[@]}" >"$DIR/apt-$1.log" 2>&1
    env -i "${variables[@]}" chroot "$run" /bin/bash -c "cd /caustique && exec $script" || status=$?
    return "$status"
}

if [ "${1:-}" = --inside ]; then
    shift
    inside "$@"
    exit
fi

# --- outside --------------------------------------------------------------------------------------------------------------

while [ $# -gt 0 ]; do
    case $1 in
        12 | 13) RELEASES=("$1") ;;
        both) RELEASES=(12 13) ;;
        --dir) DIR=${2:?--dir wants a directory} && shift ;;
        --only)
            case ${2:-} in
                demo | test | setup | package | blender) PARTS=("$2") ;;
                *) fail "--only ${2:-}" "one of: demo test setup package blender" ;;
            esac
            shift
            ;;
        --keep) KEEP=1 ;;
        *) fail "unknown argument '$1'" "tests/bare.sh [12|13|both] [--dir DIR] [--only demo|test|setup|package|blender] [--keep]" ;;
    esac
    shift
done

[ "$(id -u)" -eq 0 ] || fail "making a root needs root" "sudo $0"
command -v debootstrap >/dev/null || fail "no debootstrap" "apt-get install debootstrap"
command -v rustc >/dev/null || fail "no Rust toolchain to lend" "install Rust with rustup: https://rustup.rs"
unshare --mount --pid --fork --kill-child --propagation private true ||
    fail "this system allows no mount namespace" "run outside of a container, or in a privileged one"
SYSROOT=$(cd "$ROOT" && rustc --print sysroot)
[ -x "$SYSROOT/bin/cargo" ] || fail "$SYSROOT has no cargo of its own" "use a toolchain of rustup"
mkdir -p "$DIR/cache/pip" "$DIR/cache/registry"
DIR=$(cd "$DIR" && pwd)

[ -z "$(git -C "$ROOT" status --porcelain --untracked-files=no)" ] ||
    say "the working tree has changes that are not committed; they are not tested"

# remove DIRECTORY, which must be one of ours and must hold no mount
remove() {
    [ -e "$1" ] || return 0
    case $1 in "$DIR"/run-1[23] | "$DIR"/root-1[23]) ;; *) fail "$1 is not ours to remove" "report this" ;; esac
    ! grep -qF " $1/" /proc/self/mounts || fail "something is mounted below $1" "umount it"
    rm -rf --one-file-system "$1"
}

# Copies a file of this machine to the same place in a root, if there is one.
lend() {
    [ -f "$1" ] || return 0
    mkdir -p "$2$(dirname "$1")"
    cp -L --remove-destination "$1" "$2$1"
}

# Files of this machine for access to the package registries: names, certificates, proxies, client settings.
lend_network() {
    local file
    for file in /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt "${SSL_CERT_FILE:-}" "${PIP_CERT:-}" \
        "${CARGO_HTTP_CAINFO:-}" /etc/pip.conf; do
        lend "$file" "$1"
    done
    # The settings of apt that concern the network; hooks and clean-up rules of this machine stay behind.
    if command -v apt-config >/dev/null; then
        apt-config dump | grep -E '^Acquire::(https?|socks|Check-|Retries|ForceIPv)' \
            >"$1/etc/apt/apt.conf.d/99network" || true
    fi
    [ ! -f "$HOME/.config/pip/pip.conf" ] || install -D "$HOME/.config/pip/pip.conf" "$1/root/.config/pip/pip.conf"
    for file in config.toml config; do
        [ ! -f "${CARGO_HOME:-$HOME/.cargo}/$file" ] ||
            install -D "${CARGO_HOME:-$HOME/.cargo}/$file" "$1/root/.cargo/$file"
    done
}

# bare_root RELEASE: the bare system, made unless it is there
bare_root() {
    local root=$DIR/root-$1 suite
    case $1 in 12) suite=bookworm ;; 13) suite=trixie ;; esac
    [ ! -e "$root/.complete" ] || return 0
    remove "$root"
    say "making Debian $1 ($suite) in $root"
    # Debian's own choice of mirror; --include spares a second round of apt.
    debootstrap --variant=minbase --include=git,python3-minimal,python3,ca-certificates "$suite" "$root" >"$DIR/root-$1.log" 2>&1 ||
        fail "debootstrap failed" "see $DIR/root-$1.log"
    touch "$root/.complete"
}

# run RELEASE PART
run() {
    local log=$DIR/$2-$1.log start=$SECONDS status=0
    say "Debian $1: $2"
    unshare --mount --pid --fork --kill-child --propagation private \
        "$ROOT/tests/bare.sh" --inside "$1" "$2" "$DIR" "$SYSROOT" 2>&1 | tee "$log" || status=$?
    results+=("$(printf 'Debian %s  %-5s  exit code %d  %4d s  %s' "$1" "$2" "$status" $((SECONDS - start)) "$(tail -n 1 "$log")")")
    [ "$status" -eq 0 ] || worst=1
}

results=()
worst=0
for release in "${RELEASES[@]}"; do
    bare_root "$release"
    tree=$DIR/run-$release
    remove "$tree"
    cp -a "$DIR/root-$release" "$tree"
    lend_network "$tree"
    git clone -q --no-local "$ROOT" "$tree/caustique"
    if [[ ${PARTS[*]} = package || ${PARTS[*]} = blender ]]; then
        mkdir "$tree/packages"
        cp "$ROOT"/target/package/caustique-* "$tree/packages/" ||
            fail "there are no packages to test" "scripts/package.sh makes them"
    fi
    for part in "${PARTS[@]}"; do
        run "$release" "$part"
    done
    results+=("Debian $release  $(du -sh --one-file-system "$tree" | cut -f 1) in $tree")
    [ -n "$KEEP" ] || remove "$tree"
done
printf '\n'
printf '%s\n' "${results[@]}"
exit "$worst"
