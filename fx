#!/bin/sh
# ./fx CMD [ARG...]: run CMD where DOLFINx >= 0.9 is. Status, signals, arguments, stdin and files pass through.
#   1. inside already, or .venv in this folder, if it has DOLFINx   2. a Debian root built earlier
#   3. this machine's own Python, if it has all that is needed       4. docker or podman, if an engine answers
#   5. else build a Debian root, once, and use it
# FX=venv|native|docker|podman|root|copy forces one way; FX_SUITE=sid picks another Debian; FX_CACHE=DIR holds the roots.
# The list of packages is the Dockerfile's.
# shellcheck disable=SC2016,SC2064,SC2086  # $ns, $alone, $tty and $keep are several words or none
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
say() { printf 'fx: %s\n' "$*" >&2; }
die() { say "$*"; exit 125; }
on_signals() { pid=; for s in HUP INT QUIT TERM; do trap "$1 $s" "$s"; done; }
die_of() { trap - "$1"; kill -s "$1" $$; }
[ $# -gt 0 ] || { sed -n '2,7s/^# //p' "$here/fx" >&2; exit 2; }

export PYTHONPATH="$here${PYTHONPATH:+:$PYTHONPATH}"
export XDG_CACHE_HOME="$here/.cache" MPLCONFIGDIR="$here/.cache/matplotlib"
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"       # default BLAS threads make a sparse LU many times slower
export PETSC_OPTIONS="-no_signal_handler${PETSC_OPTIONS:+ $PETSC_OPTIONS}"   # signals are the command's own
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_btl="${OMPI_MCA_btl:-self,sm}"
export OMPI_MCA_topo="${OMPI_MCA_topo:-basic}"       # open-mpi/ompi#13918: the other one hangs now and then
case ${1##*/} in mpirun|mpiexec|prterun)             # ranks that wait leave the core to others; one rank waits for none
    export OMPI_MCA_mpi_yield_when_idle="${OMPI_MCA_mpi_yield_when_idle:-1}"
    export MPIR_CVAR_CH4_PROGRESS_THROTTLE="${MPIR_CVAR_CH4_PROGRESS_THROTTLE:-1}" ;;      # MPICH
esac
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
# unshare alone may be let through, and mount not
namespaces() { unshare $ns sh -c 'mount -t tmpfs fx /tmp && mount --rbind /proc /proc' 2>/dev/null; }

has_all() {          # a Python that imports everything; PyPI's DOLFINx needs the MPI that dolfinx_solver loads
    "$1" -c 'import contextlib
with contextlib.suppress(ModuleNotFoundError): import dolfinx_solver
import dolfinx, gmsh, matplotlib, scipy, tqdm
raise SystemExit(tuple(map(int, dolfinx.__version__.split(".")[:2])) < (0, 9))' >/dev/null 2>&1
}

venv=$here/.venv
venv_works() {       # asked once for each change of its packages
    [ -x "$venv/bin/python3" ] || return 1
    for packages in "$venv"/lib/python3*/site-packages; do
        [ ! "$venv/has_dolfinx" -nt "$packages" ] || return 0
    done
    "$venv/bin/python3" -c 'import contextlib
with contextlib.suppress(ModuleNotFoundError): import dolfinx_solver
import dolfinx' >/dev/null 2>&1 && : >"$venv/has_dolfinx"
}

native_python() {
    for p in python3 /usr/bin/python3; do
        p=$(command -v "$p" 2>/dev/null) && has_all "$p" && dirname -- "$p" && return 0
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
    say "building the image formingx:$key with $1, once (about 900 packages, 4 GB; several minutes)"
    "$1" build --build-arg SUITE="$suite" -t "formingx:$key" - < "$here/Dockerfile" >&2 &&
        "$1" run --rm --security-opt label=disable -v "$here:$here" "formingx:$key" test -e "$here/fx" >&2 && return 0
    say "$1 cannot build the image, or run it here"      # an engine on another machine does not see the checkout
    "$1" image rm "formingx:$key" >/dev/null 2>&1 || :
    return 1
}

build_root() {
    command -v mmdebstrap >/dev/null 2>&1 || {
        [ "$(id -u)" = 0 ] || die "needs mmdebstrap: ask an administrator for 'apt-get install mmdebstrap'"
        command -v apt-get >/dev/null 2>&1 || die "needs docker, podman, or a Debian-like system with apt-get"
        say "installing mmdebstrap"
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
            mmdebstrap debian-archive-keyring; } >&2 </dev/null || die "cannot install mmdebstrap with apt-get"
    }
    say "building a Debian $suite root in $root, once: about 900 packages, 0.7 GB to download, 2.2 GB on disk;"
    say "this takes 2 to 7 minutes"
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
    for p in '/usr/lib/*/libc_nonshared.a' '/usr/lib/*/libgcc*.a' '/usr/share/javascript/sphinxdoc/*'; do
        set -- "$@" --dpkgopt="path-include=$p"
    done
    # in an ordinary container nothing can be mounted; dpkg and apt do without
    alone=
    if [ "$way" = copy ]; then set -- "$@" --mode=root --skip=check/canmount
    elif [ "$(id -u)" = 0 ]; then alone='unshare --mount'; fi     # its mounts end with it
    [ "$suite" = trixie ] || set -- "$@" --aptopt='Acquire::Check-Valid-Until "false"'
    set -- --variant=minbase --dpkgopt=force-unsafe-io "$@" --include="$(printf %s "$packages" | tr ' ' ,)"
    on_signals unbuild
    # mmdebstrap ignores TERM and INT: it gets a process group, to be killed as a whole, also when this shell is killed
    setsid sh -c '(while kill -0 $0; do sleep 1; done; kill -s KILL 0) & exec "$@"' $$ \
        $alone mmdebstrap "$@" "$suite" "$root.part" >"$root.log" 2>&1 </dev/null & pid=$!
    shown=0 tick=20
    while kill -0 "$pid" 2>/dev/null; do
        sleep 1
        lines=$(grep -c '^I: ' "$root.log" || true)
        [ "$lines" -eq "$shown" ] || grep '^I: ' "$root.log" | tail -n +$((shown + 1)) | sed 's/^I:/fx:  /' >&2
        shown=$lines
        spent=$(($(date +%s) - began))
        [ "$spent" -lt "$tick" ] || { say "  $spent s"; tick=$((spent + 20)); }
    done
    rc=0; wait "$pid" || rc=$?
    kill -s KILL -- "-$pid" || :                          # the loop above
    [ "$rc" = 0 ] || {
        remove "$root.part"; tail -n 20 "$root.log" >&2
        die "the root could not be built; nothing was left behind; the whole record is in $root.log"
    }
    rm -f "$root.log"
    mv "$root.part" "$root"
    trap - HUP INT QUIT TERM
    say "built in $(($(date +%s) - began)) s"
}

unbuild() {
    trap '' HUP INT QUIT TERM
    say "interrupted: removing the unfinished root"
    [ -z "$pid" ] || { kill -s KILL -- "-$pid" || :; wait "$pid" || :; sleep 1; } 2>/dev/null
    remove "$root.part"
    rm -f "$root.log"
    die_of "$1"
}

remove() {
    [ ! -e "$1" ] || unshare $ns rm -rf --one-file-system "$1" 2>/dev/null || rm -rf --one-file-system "$1"
}

is_system() {        # a folder at the top that belongs to the system: inside, the root's own is there, read-only
    case $1 in /bin|/boot|/dev|/etc|/lib|/lib32|/lib64|/libx32|/lost+found|/proc|/run|/sbin|/sys|/usr|/var) ;;
        *) return 1 ;;
    esac
}

# What the user may write, to be at the same paths inside, one a line: the folders at the top but the system's; of the
# system's (/usr, /var) the one on the way to a place that matters which the root does not have, so that it hides nothing.
places() {
    for d in /*; do
        is_system "$d" || [ ! -d "$d" ] || printf '%s\n' "$d"
    done
    for d in "$here" "$PWD" "${HOME:-/}" "${TMPDIR:-/tmp}" /var/tmp; do
        part=
        while [ "$part" != "${d%/}" ]; do
            rest=${d#"$part"/} part=$part/${rest%%/*}
            is_system "$part" || [ "${part%/*}" ] || break          # at the top: it is there already
            [ -z "$(ls -A "$root$part" 2>/dev/null)" ] || continue
            [ ! -d "$part" ] || printf '%s\n' "$part"
            break
        done
    done | sort -u
}

# the same for a container: an engine may not see all of this machine, so only the folders at the top of what matters
seen() {
    for d in "$here" "$PWD" "${HOME:-/tmp}" "${TMPDIR:-/tmp}" /tmp; do
        rest=${d#/} top=/${rest%%/*}
        if [ "$top" = / ]; then continue; fi
        is_system "$top" || { printf '%s\n' "$top"; continue; }
        case $d/ in "$here"/|/var/?*/?*) [ ! -d "$d" ] || printf '%s\n' "${d%/}" ;; esac
    done | sort -u
}

# own mount namespace: nothing to unmount; exec all the way: one process. What holds the root is mounted first, while
# nothing is mounted in there that it would show a second time. Then the root is read-only: what would be lost fails.
run_mounted() {
    exec unshare $ns sh -c '
        root=$1 here=$2 places=$3; shift 3
        mount --bind "$root" "$root" || exit 125
        for pass in 1 2; do
            printf "%s\n" "$places" | while read -r d; do
                case $root/ in "$d"/*) [ $pass = 1 ] ;; *) [ $pass = 2 ] ;; esac || continue
                mkdir -p "$root$d" && mount --rbind "$d" "$root$d" || echo "fx: $d is not to be seen inside" >&2
            done
        done
        [ -e "$root$here/fx" ] || exit 125
        for d in proc sys dev; do mount --rbind /$d "$root/$d" || exit 125; done
        for f in /etc/resolv.conf /etc/hosts /etc/ssl/certs /etc/pip.conf; do         # for pip
            if [ -d "$f" ]; then mkdir -p "$root$f"
            elif [ ! -f "$f" ]; then continue
            elif [ ! -e "$root$f" ]; then : >"$root$f"; fi
            mount --bind "$f" "$root$f"
        done
        for d in "$root"/tmp/ompi.*.0; do       # a session folder of MPI that is not ours: it gets one of its own
            [ ! -d "$d" ] || [ -O "$d" ] || mount -t tmpfs mpi "$d"
        done
        for more in "" ,nosuid ,nodev ,nosuid,nodev; do
            mount -o "remount,bind,ro$more" "$root" 2>/dev/null && break
        done || echo "fx: files written to /etc, /usr and /var inside are not seen outside" >&2
        exec chroot "$root" "$@"' fx "$root" "$here" "$(places)" /usr/bin/env -C "$PWD" "$@"
}

device() { [ -c "$root/dev/$1" ] || { rm -f "$root/dev/$1"; mknod -m 666 "$root/dev/$1" c "$2" "$3"; }; }
empty() { find "$@" -xdev -mindepth 1 -delete; }      # the folders stay: a mount may be on one

# every path in the copy, in order; for a file with what changes when it is written, renamed or replaced
list() {
    (cd "$root$here" && find . -path ./.git -prune -o -type d -printf '- - %p\0' -o -printf '%i %C@ %p\0') >"$1" &&
        LC_ALL=C sort -z -o "$1" "$1"
}

run_copied() {       # plain chroot: the checkout goes in, what changed comes back out
    exec 8>"$root.use"
    flock -n 8 || { say "waiting for another fx to finish"; flock 8; }
    say "nothing can be mounted: running on a copy of $here; what changes comes back when the command ends"
    cwd=$(pwd -P)
    case $cwd/ in "$here"/*) ;; *) say "$cwd is not in the checkout, so not copied: using $here"; cwd=$here ;; esac
    on_signals pass
    mkdir -p "$root/dev/shm" "$root/tmp" "$root${HOME:-/root}"
    device null 1 3; device zero 1 5; device random 1 8; device urandom 1 9
    empty "$root/dev/shm" "$root/tmp"
    mkdir -p "$root$here"
    empty "$root$here"
    tar -C "$here" --exclude=./.git -cf - . | tar -C "$root$here" -xf -
    list "$root.before"
    : >"$root.began"
    sleep 0.02       # the clock of file times is coarse
    exec 7<&0
    export UCX_LOG_LEVEL=fatal HWLOC_HIDE_ERRORS=2       # they would complain that /proc and /sys are empty
    # its own session, or Ctrl-C would reach it twice
    setsid setpriv --pdeathsig TERM chroot "$root" /usr/bin/env --default-signal=INT,QUIT -C "$cwd" "$@" \
        <&7 7<&- 8>&- & pid=$!
    while rc=0; wait "$pid" 2>/dev/null || rc=$?; kill -0 "$pid" 2>/dev/null; do :; done
    trap '' HUP INT QUIT TERM
    kill -s KILL -- "-$pid" 2>/dev/null || :               # what it left running, as a container would
    # a list cut short, or a copy gone, must not pass for files removed
    { [ -e "$root$here/fx" ] && list "$root.after"; } || die "cannot read $root$here: nothing is copied back"
    cut -z -d' ' -f3- "$root.before" | LC_ALL=C sort -zr | (cd "$here" && copy=$root$here xargs -0r sh -c \
        'for f; do [ -e "$copy/$f" ] || [ -L "$copy/$f" ] || rm -df -- "$f"; done' sh) || :
    LC_ALL=C comm -z -13 "$root.before" "$root.after" | cut -z -d' ' -f3- |
        tar -C "$root$here" --no-recursion --null -T - -cf - | tar -C "$here" -xf - ||
        die "could not copy the new files back; they are in $root$here"
    empty "$root$here"
    beside || rc=125
    rm -f "$root.before" "$root.after" "$root.began"
    exit "$rc"
}

# files that the copy's command wrote beside the checkout go to the same paths; none that is there is replaced
beside() {
    (cd "$root" && find . -xdev \( -path "./${here#/}" -o -path './tmp/ompi.*' -o -path './tmp/prterun.*' \
        -o -path ./dev -o -path ./proc -o -path ./run -o -path ./sys -o -path ./usr -o -path ./var \) -prune \
        -o -type f -newer "$root.began" -print0) | root=$root xargs -0r sh -c '
        rc=0
        for f; do
            to=${f#.}
            if [ ! -e "$to" ] && mkdir -p "${to%/*}" && cp -p "$root/$f" "$to"; then rm -f "$root/$f"
            else echo "fx: $to could not be written (nothing there is replaced); it is in $root$to" >&2; rc=1; fi
        done
        exit $rc' sh
}

pass() {
    [ -n "$pid" ] || die_of "$1"
    kill -s "$1" -- "-$pid" 2>/dev/null || kill -s "$1" "$pid" 2>/dev/null || :
}

case $way in
    ''|venv|native|docker|podman|root|copy) ;;
    *) die "FX=$way: use venv, native, docker, podman, root or copy" ;;
esac
if [ -z "$way" ]; then
    if [ -z "${FX_SUITE:-}" ] && venv_works; then way=venv
    elif [ -d "$root" ]; then way=root
    elif [ -z "${FX_SUITE:-}" ] && bin=$(native_python); then way=native
    elif way=$(engine) && image "$way"; then :
    else way=root; fi
fi
case $way in
    venv)
        venv_works || die "there is no .venv in $here that imports dolfinx: python3 -m venv .venv, then" \
            ".venv/bin/pip install '.[solver]'"
        say "runs in the virtual environment $venv"
        PATH=$venv/bin:$PATH
        exec "$@" ;;
    native)
        bin=${bin:-$(native_python)} || die "no Python here imports dolfinx >= 0.9, gmsh, matplotlib, scipy and tqdm"
        say "runs with this machine's Python, $bin/python3"
        PATH=$bin:$PATH
        exec "$@" ;;
    docker|podman)
        engine "$way" >/dev/null || die "$way does not answer"
        image "$way" || exit 125
        say "runs in a container of $way"
        tty=; user="$(id -u):$(id -g)"
        [ -t 0 ] && [ -t 1 ] && tty=-t
        [ "$way" = podman ] && [ "$(id -u)" != 0 ] && keep=--userns=keep-id || keep=
        set -- "formingx:$key" "$@"
        IFS='
'
        for d in $(seen); do set -- -v "$d:$d" "$@"; done
        unset IFS
        # read-only: what would be lost with the container fails
        exec "$way" run --rm -i $tty $keep --init --shm-size=1g --user "$user" --security-opt label=disable \
            --read-only --tmpfs /run -w "$PWD" -e HOME="${HOME:-/tmp}" -e PYTHONNOUSERSITE=1 -e TMPDIR -e PYTHONPATH -e XDG_CACHE_HOME -e MPLCONFIGDIR \
            -e OMP_NUM_THREADS -e PETSC_OPTIONS -e OMPI_MCA_btl -e OMPI_MCA_topo -e OMPI_MCA_mpi_yield_when_idle -e OMPI_ALLOW_RUN_AS_ROOT -e OMPI_ALLOW_RUN_AS_ROOT_CONFIRM \
            -e PRTE_MCA_rmaps_default_mapping_policy "$@" ;;
esac
[ "$way" != root ] || namespaces || way=copy
[ "$way" != copy ] || [ "$(id -u)" = 0 ] || die "cannot mount here: run as root, or install docker or podman"
mkdir -p "$cache"
if [ ! -d "$root" ]; then      # under a lock, beside its place, then renamed: never half-built
    exec 9>"$root.lock"
    flock -n 9 || { say "waiting for another fx to build the root"; flock 9; }
    [ -d "$root" ] || build_root
    exec 9>&-
fi
# this machine's libraries and the user's own Python packages are not for the Python in there
set -- -u LD_LIBRARY_PATH -u LD_PRELOAD -u PYTHONHOME PYTHONNOUSERSITE=1 FX_INSIDE=1 PATH="$clean_path" "$@"
say "runs in the Debian root $root"
if [ "$way" = copy ]; then run_copied "$@"; else run_mounted "$@"; fi
