#!/usr/bin/env bash
# debian.sh BUILD: the packages fxdyn and libfxdyn-dev. Made twice they are the same bytes; unpacked into an empty folder, the program
# there goes from logs to tables, the module of Python there writes the same files, and the headers there are those that
# `cmake --install` of the model alone gives.
set -euo pipefail
build=$1
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "debian: $1" >&2; exit 1; }
quietly() { "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }; }
unset SOURCE_DATE_EPOCH

pack() { (cd "$build" && quietly cpack --config CPackConfig.cmake -B "$work/$1"); }
pack first
sleep 1.1 # another second than that of the first: a time stamp would show
pack second
debs=("$work"/first/*.deb)
[ "${#debs[@]}" = 2 ] || fail "${#debs[@]} packages: ${debs[*]##*/}"
for deb in "${debs[@]}"; do
  cmp "$deb" "$work/second/${deb##*/}" || fail "a second build gives other bytes: ${deb##*/}"
done
program=$(echo "$work"/first/fxdyn_*.deb) headers=$(echo "$work"/first/libfxdyn-dev_*_all.deb)

# What the packages say of themselves.
version=$(dpkg-deb -f "$program" Version)
declared=$(sed -n 's/^project(fxdyn VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
if [ -e "$root/.git" ] && hash=$(git -C "$root" rev-parse --short=7 HEAD 2>/dev/null); then
  case $version in *"g$hash"*) ;; *) git -C "$root" describe --tags --exact-match --match 'v[0-9]*' >/dev/null || fail "version $version of commit $hash" ;; esac
  newest=$(dpkg-deb --fsys-tarfile "$program" | tar -tv --utc --full-time -f - | awk '{ print $4 "T" $5 }' | sort -u)
  [ "$newest" = "$(TZ=UTC git -C "$root" log -1 --date=format-local:%Y-%m-%dT%H:%M:%S --format=%cd)" ] || fail "files of $newest, not of the commit"
else
  [ "$version" = "$declared" ] || fail "version $version without git"
fi
dpkg --compare-versions "$version" gt "$declared~" || fail "version $version is older than anything of $declared"
[ "$(dpkg-deb -f "$headers" Version)" = "$version" ] || fail "two versions"
for library in libc6 libstdc++6 libfmt9 libmatio11 libsqlite3-0 gnuplot-nox; do
  dpkg-deb -f "$program" Depends | grep -qF "$library " || fail "does not depend on $library"
done
[ "$(dpkg-deb -f "$headers" Depends)" = libeigen3-dev ] || fail "libfxdyn-dev depends on $(dpkg-deb -f "$headers" Depends)"

# The headers' package is the model's installation.
dpkg -x "$headers" "$work/dev"
quietly cmake -S "$root" -B "$work/model" -DFXDYN_MODEL_ONLY=ON -DCMAKE_INSTALL_PREFIX=/usr -DFXDYN_EFFECTS=
DESTDIR=$work/alone quietly cmake --install "$work/model"
diff -r "$work/alone/usr" "$work/dev/usr" || fail "libfxdyn-dev is not what the model alone installs"

# The program, with nothing of fxdyn but what its package has.
dpkg -x "$program" "$work/clean"
usr=$work/clean/usr
packages=$usr/lib/python3/dist-packages
modules=()
if grep -qx 'FXDYN_PYTHON:BOOL=ON' "$build/CMakeCache.txt"; then modules=("$packages"/fxdyn/stages*.so); fi
for file in "$usr"/bin/* "$usr"/lib/fxdyn/*.so "${modules[@]}"; do
  [ -f "$file" ] || fail "no $file"
  if ldd "$file" | grep -e "not found" -e "$build"; then fail "$file needs libraries of the build folder"; fi
  if readelf -d "$file" | grep -e "PATH.*$root" -e "PATH.*$build"; then fail "$file looks into the build folder"; fi
done
zcat "$usr/share/man/man1/fxdyn-run.1.gz" | grep -q '^.SH OPTIONS' || fail "no page for run"
[ "$(find "$usr/share/man/man1" -name '*.gz' | wc -l)" -gt 25 ] || fail "not every verb has its page"
bash -c "source '$usr/share/bash-completion/completions/fxdyn' && complete -p fxdyn" >/dev/null || fail "no completion"
[ -s "$usr/share/zsh/vendor-completions/_fxdyn" ] || fail "no completion for zsh"

mkdir "$work/robot" && cd "$work/robot"
python3 -B -c "
import pathlib, sys
sys.path.insert(0, '$root/tests/mistakes')
import good
for name, text in good.files().items():
    pathlib.Path(name).write_text(text)
"
clean() { quietly env -i HOME="$work" PATH="$usr/bin:/usr/bin:/bin" LC_ALL=C "$@"; }
clean fxdyn check robot.toml
clean fxdyn run robot.toml --out out
clean fxdyn verify out
clean fxdyn export robot.toml --out out --to sdf
[ -s out/tables.hpp ] && [ -s out/report.html ] || fail "no tables or no report"
if [ "${#modules[@]}" -gt 0 ]; then
  clean PYTHONPATH="$packages" /usr/bin/python3 -B -c '
import fxdyn
assert fxdyn.__file__.startswith("'"$usr"'"), fxdyn.__file__
assert len(fxdyn.run("robot.toml", "from_python")["model"]["joints"]) == 2'
  for file in model.json metrics.json diagnosis.json tables.bin report.html; do
    cmp "out/$file" "from_python/$file" || fail "the module of Python writes another $file"
  done
fi
