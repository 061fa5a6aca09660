#!/bin/sh
# ./fx CMD [ARG...]: run CMD where DOLFINx >= 0.9 is. Status, signals, arguments, stdin and files pass through.
#   1. inside already, or a Debian root built earlier   2. this machine's own Python, if it has all that is needed
#   3. docker or podman, if an engine answers            4. else build a Debian root, once, and use it
# FX=native|docker|podman|root|copy forces one way; FX_SUITE=sid picks another Debian; FX_CACHE=DIR holds the roots.
# The list of packages is the Dockerfile's.
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
say() { printf 'fx: %s\n' "$*" >&2; }
die() { say "$*"; exit 125; }
[ $# -gt 0 ] || { sed -n '2,6s/^# //p' "$here/fx" >&2; exit 2; }

export PYTHONPATH="$here${PYTHONPATH:+:$PYTHONPATH}"
export XDG_CACHE_HOME="$here/.cache" MPLCONFIGDIR="$here/.cache/matplotlib"
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"       # default BLAS threads make a sparse LU many times slower
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_btl="${OMPI_MCA_btl:-self,sm}"
export PRTE_MCA_rmaps_default_mapping_policy="${PRTE_MCA_rmaps_default_mapping_policy:-:oversubscribe}"

way=${FX:-}
[ -z "${FX_INSIDE:-}" ] || exec "$@"

suite=${FX_SUITE:-$(sed -n 's/^ARG SUITE=//p' "$here/Dockerfile")}
# shellcheck disable=SC1003  # the backslash is what tr removes
packages=$(sed -n '/^ARG PACKAGES="/,/"$/p' "$here/Dockerfile" | sed 's/^ARG PACKAGES=//' |
    tr -d '"\\' | tr -s ' \n' '  ' | sed 's/^ //; s/ $//')
key=$(printf '%s %s' "$suite" "$packages" | cksum | tr ' ' -)
cache=${FX_CACHE:-${XDG_DATA_HOME:-${HOME:-/root}/.local/share}/formingx}
root=$cache/$key
clean_path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
if [ "$(id -u)" = 0 ]; then ns='--mount'; else ns='--mount --map-root-user --map-auto'; fi
# shellcheck disable=SC2086  # $ns is several words on purpose
namespaces() { unshare $ns true 2>/dev/null; }

native_python() {    # a Python that imports everything, if there is one
    for p in python3 /usr/bin/python3; do
        p=$(command -v "$p" 2>/dev/null) || continue
        "$p" -c 'import dolfinx, gmsh, matplotlib, scipy, tqdm
raise SystemExit(tuple(map(int, dolfinx.__version__.split(".")[:2])) < (0, 9))' >/dev/null 2>&1 || continue
        dirname -- "$p"
        return 0
    done
    return 1
}

engine() {           # a container engine that answers (a client without a daemon does not)
    for e in ${1:-docker podman}; do
        command -v "$e" >/dev/null 2>&1 && timeout 20 "$e" info >/dev/null 2>&1 && { echo "$e"; return 0; }
    done
    return 1
}

image() {
    "$1" image inspect "formingx:$key" >/dev/null 2>&1 && return 0
    say "building the image formingx:$key with $1, once (about 700 packages, 4 GB; several minutes)"
    "$1" build --build-arg SUITE="$suite" -t "formingx:$key" - < "$here/Dockerfile" >&2
}

build_root() {
    command -v mmdebstrap >/dev/null 2>&1 || {
        [ "$(id -u)" = 0 ] || die "needs mmdebstrap: ask an administrator for 'apt-get install mmdebstrap'"
        command -v apt-get >/dev/null 2>&1 || die "needs docker, podman, or a Debian-like system with apt-get"
        say "installing mmdebstrap"
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
            mmdebstrap debian-archive-keyring; } >&2 </dev/null || die "cannot install mmdebstrap with apt-get"
    }
    say "building a Debian $suite root in $root, once: about 700 packages, 0.6 GB to download, 1.7 GB on disk;"
    say "this takes 2 to 5 minutes"
    began=$(date +%s)
    remove "$root.part"
    set --
    for p in doc man info locale javascript occt opencascade unicode 'cmake-*'; do
        set -- "$@" --dpkgopt="path-exclude=/usr/share/$p/*"
    done
    for p in '/usr/include/boost/*' '/usr/include/eigen3/*' '/usr/include/unicode/*' '/usr/libexec/valgrind/*' \
        '/usr/bin/cpack' '/usr/bin/ctest' '/usr/bin/lto-dump*' '/usr/bin/*-lto-dump*' '/usr/libexec/gcc/*/*/f951' \
        '/usr/libexec/gcc/*/*/cc1plus' '/usr/libexec/gcc/*/*/lto1' '/usr/lib/*/libamd_comgr*' \
        '/usr/lib/*/libLLVM*17*' '/usr/lib/python3/dist-packages/*/tests/baseline_images/*' '/usr/lib/*.a'; do
        set -- "$@" --dpkgopt="path-exclude=$p"
    done
    for p in libc_nonshared.a 'libgcc*.a'; do set -- "$@" --dpkgopt="path-include=/usr/lib/*/$p"; done
    # in an ordinary container nothing can be mounted; dpkg and apt do without
    if [ "$way" = copy ]; then set -- "$@" --mode=root --skip=check/canmount; fi
    [ "$suite" = trixie ] || set -- "$@" --aptopt='Acquire::Check-Valid-Until "false"'
    mmdebstrap --variant=minbase --dpkgopt=force-unsafe-io "$@" \
        --include="$(printf %s "$packages" | tr ' ' ,)" "$suite" "$root.part" >"$root.log" 2>&1 </dev/null & pid=$!
    trap 'say "interrupted: removing the unfinished root"; kill "$pid"; wait "$pid"; remove "$root.part"; exit 130' \
        INT TERM HUP
    shown=0
    while kill -0 "$pid" 2>/dev/null; do
        sleep 1
        lines=$(grep -c '^I: ' "$root.log" || true)
        [ "$lines" -eq "$shown" ] || grep '^I: ' "$root.log" | tail -n +$((shown + 1)) | sed 's/^I:/fx:  /' >&2
        shown=$lines
        [ $((($(date +%s) - began) % 20)) -ne 0 ] ||
            say "  $(($(date +%s) - began)) s"
    done
    wait "$pid" || {
        remove "$root.part"; tail -n 20 "$root.log" >&2
        die "the root could not be built; nothing was left behind; the whole record is in $root.log"
    }
    rm -f "$root.log"
    trap - INT TERM HUP
    mv "$root.part" "$root"
    say "built in $(($(date +%s) - began)) s"
}

remove() {
    # shellcheck disable=SC2086
    [ ! -e "$1" ] || unshare $ns rm -rf --one-file-system "$1" 2>/dev/null || rm -rf --one-file-system "$1"
}

run_mounted() {      # own mount namespace: nothing to unmount; exec all the way: one process
    case $PWD/ in
        "$here"/*|//|/bin/*|/dev/*|/etc/*|/lib*|/proc/*|/run/*|/sbin/*|/sys/*|/usr/*|/var/*) also=$here ;;
        *) also=$PWD ;;
    esac
    # shellcheck disable=SC2086,SC2016
    exec unshare $ns sh -c '
        root=$1 here=$2 also=$3 cwd=$4 path=$5; shift 5
        for d in proc sys dev; do mount --rbind /$d "$root/$d" || exit 125; done
        mount -t tmpfs -o mode=1777 tmp "$root/tmp" || exit 125
        for d in "$here" "$also"; do
            [ -d "$root$d" ] || mkdir -p "$root$d"
            mount --rbind "$d" "$root$d" || exit 125
        done
        exec chroot "$root" /usr/bin/env -C "$cwd" HOME=/tmp FX_INSIDE=1 PATH="$path" "$@"' \
        fx "$root" "$here" "$also" "$PWD" "$clean_path" "$@"
}

device() { [ -c "$root/dev/$1" ] || { rm -f "$root/dev/$1"; mknod -m 666 "$root/dev/$1" c "$2" "$3"; }; }

run_copied() {       # plain chroot: the checkout goes in, what changed comes back out
    exec 8>"$root.use"
    flock -n 8 || { say "waiting for another fx to finish"; flock 8; }
    mkdir -p "$root/dev/shm" "$root/tmp"
    chmod 1777 "$root/dev/shm" "$root/tmp"
    device null 1 3; device zero 1 5; device random 1 8; device urandom 1 9
    rm -rf "${root:?}$here"
    mkdir -p "$root$here"
    tar -C "$here" --exclude=./.git -cf - . | tar -C "$root$here" -xf -
    case $PWD/ in "$here"/*) cwd=$PWD ;; *) cwd=$here ;; esac
    stamp=$root.stamp
    touch "$stamp"; sleep 0.01
    exec 7<&0
    env --default-signal=INT,QUIT chroot "$root" /usr/bin/env -C "$cwd" HOME=/tmp FX_INSIDE=1 PATH="$clean_path" \
        "$@" <&7 & pid=$!
    for s in INT TERM HUP; do
        # shellcheck disable=SC2064
        trap "kill -$s $pid 2>/dev/null" "$s"
    done
    while :; do
        if wait "$pid"; then rc=0; else rc=$?; fi
        kill -0 "$pid" 2>/dev/null || break
    done
    (cd "$root$here" && find . -type f -newer "$stamp" -print0 | tar --null -T - -cf -) | tar -C "$here" -xf -
    rm -rf "${root:?}$here"
    exit "$rc"
}

case $way in
    ''|native|docker|podman|root|copy) ;;
    *) die "FX=$way is not known; use native, docker, podman, root or copy" ;;
esac
if [ -z "$way" ]; then
    if [ -d "$root" ]; then way=root
    elif [ -z "${FX_SUITE:-}" ] && bin=$(native_python); then way=native
    elif way=$(engine) && image "$way"; then :
    else way=root; fi
fi
case $way in
    native)
        bin=${bin:-$(native_python)} || die "no Python here imports dolfinx >= 0.9, gmsh, matplotlib, scipy and tqdm"
        PATH=$bin:$PATH
        exec "$@" ;;
    docker|podman)
        engine "$way" >/dev/null || die "$way does not answer"
        image "$way" || die "$way could not build the image"
        tty=; user="$(id -u):$(id -g)"
        [ -t 0 ] && [ -t 1 ] && tty=-t
        [ "$way" = podman ] && [ "$(id -u)" != 0 ] && keep=--userns=keep-id || keep=
        # shellcheck disable=SC2086
        exec "$way" run --rm -i $tty $keep --init --shm-size=1g --user "$user" -e HOME=/tmp -v "$here:$here" -w "$PWD" \
            -e PYTHONPATH -e XDG_CACHE_HOME -e MPLCONFIGDIR -e OMP_NUM_THREADS -e OMPI_MCA_btl \
            -e OMPI_ALLOW_RUN_AS_ROOT -e OMPI_ALLOW_RUN_AS_ROOT_CONFIRM -e PRTE_MCA_rmaps_default_mapping_policy \
            "formingx:$key" "$@" ;;
esac
if [ "$way" = root ] && ! namespaces; then
    [ "$(id -u)" = 0 ] || die "cannot make a mount namespace here: run as root, or install docker or podman"
    way=copy
fi
mkdir -p "$cache"
if [ ! -d "$root" ]; then      # under a lock, beside its place, then renamed: never half-built
    exec 9>"$root.lock"
    flock -n 9 || { say "waiting for another fx to build the root"; flock 9; }
    [ -d "$root" ] || build_root
    exec 9>&-
fi
if [ "$way" = copy ]; then run_copied "$@"; else run_mounted "$@"; fi
