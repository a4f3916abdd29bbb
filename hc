#!/bin/sh
# The hc command of this checkout. On first use it makes the environment (.venv) from the pinned
# and hashed requirements.lock, compiles the messages and the estimators; after that it only
# compares fingerprints and starts. It starts over when the lock file changed, and compiles the
# messages again when their definitions changed.
#
#   HC_PYTHON=/path/to/python3.12 ./hc ...   take that Python instead of searching one
set -eu

root=$(dirname "$(readlink -f "$0")")
environment=$root/.venv
log=$root/.venv.log

fail() {
    printf 'hc: %s\n' "$1" >&2
    exit 1
}

# Python cannot start there, and what is left behind would pass for broken byte code.
[ -e "${PWD:-}" ] || case $(readlink /proc/self/cwd) in
*' (deleted)') fail 'the folder that you are in has been deleted: go to another one (cd)' ;;
esac

fingerprint() { # of what the environment was made from, and of what the messages were made from
    case $1 in
    environment) { printf '%s\n' "$root"; cat "$root/requirements.lock"; } ;;
    messages) sed '/^# What follows concerns/,$d' "$root/pyproject.toml"
        cat "$root"/src/hc_msgs/CMakeLists.txt \
        "$root"/src/hc_msgs/package.xml "$root"/src/hc_msgs/wheels_* "$root"/src/hc_msgs/*/*.msg \
        "$root"/src/hc_msgs/tf2_msgs/*.* "$root"/src/hc_msgs/tf2_msgs/msg/*.msg ;;
    esac | sha256sum
}

is_current() { # part
    [ -f "$environment/.$1" ] && [ "$(cat "$environment/.$1")" = "$(fingerprint "$1")" ]
}

usable_python() { # path: the versions that the ROS wheels exist for
    "$1" -c 'import sys; raise SystemExit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' \
        >/dev/null 2>&1
}

find_python() {
    if [ -n "${HC_PYTHON:-}" ]; then
        usable_python "$HC_PYTHON" || fail "HC_PYTHON=$HC_PYTHON is not a Python from 3.10 to 3.13: name another one, or unset it"
        command -v "$HC_PYTHON"
        return
    fi
    for name in python3 python3.13 python3.12 python3.11 python3.10; do
        if command -v "$name" >/dev/null 2>&1 && usable_python "$name"; then
            command -v "$name"
            return
        fi
    done
}

check_machine() { # sets python
    [ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] ||
        fail "this is $(uname -s) on $(uname -m), and ROS 2 Jazzy comes as wheels for Linux on x86-64 only: use such a machine or a container"
    glibc=$(getconf GNU_LIBC_VERSION 2>/dev/null | sed 's/^glibc 2\.//')
    [ "${glibc:-0}" -ge 28 ] 2>/dev/null ||
        fail "this system has no glibc 2.28 or newer, which the ROS 2 wheels need: use Debian 10, Ubuntu 20.04, RHEL 8 or newer"
    missing='' packages=''
    python=$(find_python)
    if [ -z "$python" ]; then
        missing="$missing, Python 3.10 to 3.13" packages="$packages python3 python3-venv python3-dev"
    else
        "$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
            missing="$missing, Python's venv module" packages="$packages python3-venv"
        "$python" -c 'import os, sysconfig; raise SystemExit(not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")))' ||
            missing="$missing, Python headers (Python.h)" packages="$packages python3-dev"
    fi
    command -v "${CC:-cc}" >/dev/null 2>&1 || missing="$missing, a C compiler (cc)" packages="$packages gcc"
    command -v "${CXX:-c++}" >/dev/null 2>&1 || missing="$missing, a C++ compiler (c++)" packages="$packages g++"
    [ -z "$missing" ] ||
        fail "missing:${missing#,}. On Debian and Ubuntu: sudo apt-get install$packages"
}

run_logged() { # what it is for, command...: output goes to the log, the end of it is shown on failure
    what=$1
    shift
    if ! "$@" >>"$log" 2>&1; then
        tail -n 15 "$log" >&2
        fail "$what failed; the whole output is in $log"
    fi
}

count_packages() { # shows how far pip is: one line that is rewritten, or a line per 50 packages
    total=$(grep -c == "$root/requirements.lock")
    terminal=0
    [ -t 2 ] && terminal=1
    awk -v total="$total" -v terminal="$terminal" -v log_file="$log" '
        { print >> log_file }
        /^(Collecting|Requirement already|Ignoring)/ {
            count++
            if (terminal) printf "\r[2/4] downloading packages: %d of %d ", count, total > "/dev/stderr"
            else if (count % 50 == 0) printf "[2/4] downloading packages: %d of %d\n", count, total > "/dev/stderr"
        }
        /^Installing collected/ {
            if (terminal) printf "\r\033[K" > "/dev/stderr"
            printf "[2/4] installing packages\n" > "/dev/stderr"
        }'
}

# What compiling the estimators needs: that begins as soon as these are there.
kernel_packages='numpy numba llvmlite scipy pyyaml'

install() { # requirements file: byte code is made at the first import, of what is imported at all
    "$environment/bin/python" -m pip install --no-input --disable-pip-version-check --no-deps \
        --no-compile --require-hashes --requirement "$1"
}

make_environment() {
    printf '[1/4] making the environment %s with %s\n' "$environment" "$("$python" --version)" >&2
    rm -f "$environment/.environment" "$environment/.messages"
    run_logged 'making the environment' "$python" -m venv --clear "$environment"
    printf '[2/4] fetching packages (about a minute)\n' >&2
    first=$environment/.kernel_packages
    awk -v names=" $kernel_packages " '/^[^ ]*==/ { name = $1; sub(/==.*/, "", name)
        wanted = index(names, " " name " ") } wanted' "$root/requirements.lock" >"$first"
    run_logged 'installing the packages (is a package index reachable?)' install "$first"
    compile_ahead
    status=$environment/.pip_status
    { install "$root/requirements.lock" 2>&1 && echo 0 >"$status" || echo 1 >"$status"; } |
        count_packages
    if [ "$(cat "$status")" != 0 ]; then
        tail -n 15 "$log" >&2
        fail "installing the packages failed (is a package index reachable?); the whole output is in $log"
    fi
    fingerprint environment >"$environment/.environment"
}

compile_ahead() { # beside what follows: the filters' code needs neither messages nor other packages
    [ -z "${ahead:-}" ] || return 0
    ahead_log=$environment/.compiling_ahead
    taken=$environment/.compiling # which of the two processes compiles what
    rm -rf "$taken"
    mkdir "$taken"
    PYTHONSAFEPATH=1 PYTHONPATH="$root/src/hc_bringup:$root/src/hc_estimator:$root/src/hc_msgs_py" \
        "$environment/bin/python" -m hc_bringup.warm_up ahead "$taken" >"$ahead_log" 2>&1 &
    ahead=$!
    trap 'kill "$ahead" 2>/dev/null || true' EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM
}

make_messages() {
    printf '[3/4] compiling the messages and the estimators (three to four minutes)\n' >&2
    compile_ahead
    run_logged 'compiling the messages' "$environment/bin/python" -m pip install --no-input \
        --disable-pip-version-check --no-deps --no-build-isolation --editable "$root"
    printf '[4/4] compiling what is left of the estimators\n' >&2
    run_logged 'compiling the estimators' "$environment/bin/python" -m hc_bringup.warm_up rest "$taken"
    wait "$ahead" || {
        cat "$ahead_log" >>"$log"
        tail -n 15 "$ahead_log" >&2
        fail "compiling the estimators failed; the whole output is in $log"
    }
    trap - EXIT INT TERM
    fingerprint messages >"$environment/.messages"
    printf 'ready\n' >&2
}

# Byte code is kept beside the environment, also where PYTHONDONTWRITEBYTECODE is set, as containers
# do: without it every process compiles numba and ourselves anew, three quarters of a node's start.
unset PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX="$environment/byte_code"

if ! is_current environment || ! is_current messages; then
    check_machine
    exec 9>"$root/.venv.lock"
    command -v flock >/dev/null 2>&1 && flock 9 # a second hc waits here until the first is done
    : >"$log"
    is_current environment || make_environment
    is_current messages || make_messages
    exec 9>&-
fi

# A start takes the marker of its own away as soon as it is at our code (hc_bringup/byte_code.py).
# One that stayed behind is of a Python that could not even read its byte code, as after a disk was
# full: without it the next start makes it anew.
marker=$environment/.starting.
for left in "$marker"*; do
    if [ -w "$left" ] && [ ! -e "/proc/${left#"$marker"}" ]; then
        printf 'hc: the last start broke off within Python: its byte code is made anew\n' >&2
        # Others that run meanwhile may write there again.
        rm -rf "$PYTHONPYCACHEPREFIX" "$left" 2>/dev/null || rm -f "$left"
    fi
done

# Packages beside the user's files must not shadow ours.
export PYTHONSAFEPATH=1
export HC_ROOT="$root"
# An interrupt waits until the command can answer it (hc_bringup/entry.py), where env knows how.
blocking=''
env --block-signal=INT true 2>/dev/null && blocking='env --block-signal=INT'
trap 'rm -f "$marker$$"; exit 130' INT # interrupted here, nothing broke off
{ true >"$marker$$"; } 2>/dev/null || true # where nothing can be written nothing is damaged
exec $blocking "$environment/bin/hc" "$@"
