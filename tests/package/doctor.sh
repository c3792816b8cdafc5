#!/usr/bin/env bash
# doctor.sh FXDYN: `fxdyn doctor` says what is missing on a machine without any program, and how to get it.
set -euo pipefail
fxdyn=$1
fail() { echo "doctor: $1" >&2; exit 1; }
[ "$(set +e; PATH='' "$fxdyn" doctor >/dev/null 2>&1; echo $?)" = 1 ] || fail "no exit code 1 without gnuplot"
said=$(PATH='' "$fxdyn" doctor 2>&1 || true)
has() { case "$said" in *"$1"*) ;; *) fail "does not say '$1' in: $said" ;; esac; }
for command in gnuplot-nox gcc-arm-none-eabi qemu-system-arm cmake ninja-build openocd; do has "apt-get install $command"; done
has "fxdyn: gnuplot is missing, which run, report, excite, forward need: "
# With one that need only be there, the verbs of the host run; the rest is still named.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
printf '#!/bin/sh\n' >"$folder/gnuplot" && chmod +x "$folder/gnuplot"
said=$(PATH=$folder TMPDIR=$folder LC_ALL=C "$fxdyn" doctor 2>&1) || fail "exit code $? though all that the host needs is there: $said"
has "$folder/gnuplot"
has "all verbs that need no target run on this machine"
has "apt-get install g++"
# A folder for plots that is none, and a locale that is not installed.
if said=$(PATH=$folder TMPDIR=/nowhere LC_ALL=C "$fxdyn" doctor 2>&1); then fail "takes a TMPDIR that is none"; fi
has "export TMPDIR=/tmp"
said=$(PATH=$folder TMPDIR=$folder LC_ALL=xx_XX.UTF-8 "$fxdyn" doctor 2>&1) || fail "a locale alone stops no verb"
has "xx_XX.UTF-8 is not installed"
# On this machine: nothing of the tests' own packages is said to be missing.
said=$(LC_ALL=C "$fxdyn" doctor 2>&1) || fail "of this machine: $said"
case "$said" in *"apt-get install"*) fail "a package of setup.sh is missing here: $said" ;; esac
"$fxdyn" doctor --help | grep -q "Example: fxdyn doctor" || fail "no example in --help"
