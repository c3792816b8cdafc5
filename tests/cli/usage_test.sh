#!/usr/bin/env bash
# usage_test.sh FXDYN: usage errors name a command that works; completion and manual pages know what --help knows.
set -euo pipefail
fxdyn=$1
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
failed=0
fail() {
  echo "FAILED: $*" >&2
  failed=1
}

# complains ARGUMENTS.. : usage error in one line, of which "$said" is a part
complains() {
  local code=0
  "$fxdyn" "$@" >"$work/out" 2>"$work/err" || code=$?
  [ "$code" -eq 2 ] || fail "$*: exit code $code"
  [ "$(wc -l <"$work/err")" -eq 1 ] || fail "$*: $(wc -l <"$work/err") lines"
  grep -qF -- "$said" "$work/err" || fail "$*: no '$said' in: $(cat "$work/err")"
}
said='as in `fxdyn report robot.toml --out there`' complains reprot robot.toml --out there
said='as in `fxdyn run robot.toml --out=there`' complains run robot.toml --uot=there
said='as in `fxdyn run robot.toml --out out/robot`' complains run
said='as in `fxdyn run robot.toml --out out/robot`' complains
said="'xyzzy' is no verb: as in \`fxdyn run" complains xyzzy
said="'two.toml' was not expected: as in \`fxdyn run robot.toml --out out/robot\`" complains run one.toml two.toml --out x
said='--out' complains run robot.toml
said='bash' complains completion fish
said='as in `fxdyn man report`' complains man reprot

# every verb of --help and every long option of its --help, as bash completes them
# shellcheck source=/dev/null
source <("$fxdyn" completion bash)
"$fxdyn" completion zsh >"$work/zsh"
# words are grepped from files: a pipe would break where grep has seen enough
complete_words() {
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  COMPREPLY=()
  _fxdyn
  printf "%s\n" "${COMPREPLY[@]}" >"$work/words"
}
verbs=$("$fxdyn" --help | sed -n '/^Subcommands:/,$s/^  \([a-z]\+\).*/\1/p')
[ "$(wc -w <<<"$verbs")" -ge 20 ] || fail "--help has $(wc -w <<<"$verbs") verbs"
for verb in $verbs; do
  complete_words fxdyn ""
  grep -qx "$verb" "$work/words" || fail "bash does not complete $verb"
  grep -q "^ *'$verb:" "$work/zsh" || fail "zsh does not complete $verb"
  "$fxdyn" man "$verb" >"$work/page"
  grep -q "^.SH OPTIONS" "$work/page" || fail "man $verb has no options"
  for option in $("$fxdyn" "$verb" --help | sed -n 's/^  \(-[a-z],\)\?\(--[a-z-]*\).*/\2/p'); do
    complete_words fxdyn "$verb" "$option"
    grep -qx -- "$option" "$work/words" || fail "bash does not complete $verb $option"
    grep -q -- " $verb) _arguments.*'$option\[" "$work/zsh" || fail "zsh does not complete $verb $option"
    grep -qF -- "\\fB${option//-/\\-}\\fR" "$work/page" || fail "man $verb does not name $option"
  done
done
complete_words fxdyn rep
[ "$(sort "$work/words" | xargs)" = "replay report" ] || fail "rep: $(xargs <"$work/words")"
complete_words fxdyn run rob
[ -z "$(xargs <"$work/words")" ] || fail "a file name is not left to bash"
if command -v groff >/dev/null; then
  "$fxdyn" man >"$work/page"
  groff -man -Tascii -ww "$work/page" >"$work/text" 2>"$work/warned" || fail "groff refuses the page"
  [ ! -s "$work/warned" ] || fail "groff: $(head -1 "$work/warned")"
  [ "$(wc -l <"$work/text")" -gt 50 ] || fail "the page has $(wc -l <"$work/text") lines"
fi
exit $failed
