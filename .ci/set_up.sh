#!/usr/bin/env bash
# Builds .venv from requirements.lock, or brings it up to date; says nothing when there is nothing to do.
# What each step was done for is noted inside .venv, by content: a fresh date on a file costs nothing.
#
#   set_up.sh [PYTHON]      PYTHON: the interpreter to build on; left out, an existing .venv keeps its own
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-}
bin=.venv/bin
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PYTHONWARNINGS=

digest() { "$bin/python" -c 'import hashlib, sys; print(hashlib.sha256(sys.stdin.buffer.read()).hexdigest())'; }
noted() { [ -f ".venv/$1" ] && [ "$(cat ".venv/$1")" = "$2" ]; }
say() { echo "set-up: $*" >&2; }
version_of() { "$1" -c 'import sys; print(sys.implementation.name, *sys.version_info[:2])' 2>/dev/null || true; }

# 1. An interpreter, on a machine that has what it needs. A .venv that was left half made, that was moved, or that
# was built on another Python or from another lock, is built anew.
start=keep
if [ ! -x "$bin/python" ] || ! "$bin/python" -c 'import pip' 2>/dev/null; then
    start=anew
elif [ -n "$python" ] && [ "$(version_of "$bin/python")" != "$(version_of "$python")" ]; then
    start=anew
elif [ -f .venv/built-from ] && ! { noted built-from "$(digest <requirements.lock)" && noted built-in "$PWD"; }; then
    start=anew
fi
if [ "$start" = keep ]; then
    sh .ci/check_system.sh "$bin/python"
else
    python=${python:-python3}
    sh .ci/check_system.sh "$python"
    say "making .venv on $("$python" --version)"
    "$python" -m venv --clear .venv
fi

# 2. The packages of the lock, each checked against its hash; wheels only, so no compiler is needed.
lock=$(digest <requirements.lock)
if ! noted built-from "$lock"; then
    total=$(grep -c '^[a-z]' requirements.lock || true)
    say "installing the packages of requirements.lock (about $total, 2 GB on disk, a few minutes)"
    log=.venv/install.log
    if ! "$bin/python" -m pip install --require-hashes --only-binary :all: --no-deps --progress-bar off \
        -r requirements.lock 2>&1 | tee "$log" |
        awk '/^(Collecting|Requirement already satisfied)/ && ++n % 40 == 0 { print "set-up: " n " packages found"; fflush() }
             /^Installing collected/ { print "set-up: unpacking them"; fflush() }' >&2; then
        grep -v '^ ' "$log" | tail -n 5 >&2
        say "the packages could not be installed; the whole record is in $log"
        exit 1
    fi
    pwd >.venv/built-in
    echo "$lock" >.venv/built-from
    rm -f .venv/installed-for
fi

# 3. The project itself, from its own folder.
project=$(digest <pyproject.toml)
if ! noted installed-for "$project"; then
    say "installing sec_lab"
    "$bin/python" -m pip install --quiet --no-deps --no-build-isolation --editable .
    echo "$project" >.venv/installed-for
fi

# 4. Compiled kernels, cached beside their sources.
sources=$(find sec_lab -name '*.py' -print0 | LC_ALL=C sort -z | xargs -0 cat | digest)
if ! noted warmed-for "$sources"; then
    say "compiling the kernels"
    # numba does not notice when a function that a compiled one calls has changed in another file.
    find sec_lab -name '*.nb[ic]' -delete
    "$bin/python" -m sec_lab.warm
    echo "$sources" >.venv/warmed-for
fi
