#!/bin/sh
# What the machine itself must provide, before anything is installed: Python >= 3.11 with venv, git, and the shared
# libraries that Python packages load from the system. Says nothing if all is there; otherwise one line that names
# what is missing and the command that installs it, and exit code 1.
#
#   check_system.sh [--packages] [PYTHON]      --packages: only the names of the missing Debian packages, one a line

list_only=no
if [ "${1-}" = "--packages" ]; then
    list_only=yes
    shift
fi
python=${1:-python3}
missing=""
packages=""

needs() { # needs WHAT DEBIAN-PACKAGE
    missing="${missing:+$missing, }$1"
    packages="${packages:+$packages }$2"
}

name=${python##*/}
case $name in python3.[0-9]*) debian_python=$name ;; *) debian_python=python3 ;; esac
if ! command -v "$python" >/dev/null 2>&1; then
    needs "Python 3.11 or newer (no $python)" "$debian_python $debian_python-venv"
elif ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    version=$("$python" -c 'import platform; print(platform.python_version())' 2>/dev/null || echo unusable)
    needs "Python 3.11 or newer ($python is $version; another one: make PYTHON=python3.11)" "python3.11 python3.11-venv"
elif ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    needs "Python's venv module with ensurepip" "$debian_python-venv"
fi
command -v git >/dev/null 2>&1 || needs git git

# Drake's wheel links GLib; its cameras load EGL, X11 and GL when they render, and Debian's libgl1 brings the driver that
# renders without a graphics card. Without ldconfig (not Linux) there is nothing to ask.
ldconfig=$(PATH="$PATH:/usr/sbin:/sbin" command -v ldconfig || true)
if [ "$(uname -s)" = Linux ] && [ -n "$ldconfig" ]; then
    libraries=$("$ldconfig" -p)
    while read -r library package; do
        case $libraries in
            *"$library "*) ;;
            *) needs "$library" "$package" ;;
        esac
    done <<END
libglib-2.0.so.0 libglib2.0-0
libX11.so.6 libx11-6
libEGL.so.1 libegl1
libGL.so.1 libgl1
END
fi

[ -n "$missing" ] || exit 0
if [ "$list_only" = yes ]; then
    printf '%s\n' $packages
else
    sudo=""
    [ "$(id -u)" = 0 ] || sudo="sudo "
    echo "Missing on this machine: $missing. Install with: ${sudo}apt-get update && ${sudo}apt-get install -y $packages" >&2
fi
exit 1
