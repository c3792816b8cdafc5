#!/usr/bin/env bash
# shell_files.sh FXDYN DIR: what a package has beside the program, as the program itself prints it: manual pages and completions, in
# DIR as below a prefix.
set -euo pipefail
fxdyn=$1 share=$2/share
rm -rf "$share"
mkdir -p "$share/man/man1" "$share/bash-completion/completions" "$share/zsh/vendor-completions"
"$fxdyn" completion bash >"$share/bash-completion/completions/fxdyn"
"$fxdyn" completion zsh >"$share/zsh/vendor-completions/_fxdyn"
page() { "$fxdyn" man "${@:2}" | gzip -9n >"$share/man/man1/$1.1.gz"; }
page fxdyn
for verb in $("$fxdyn" --help | sed -n '/^Subcommands:/,$s/^  \([a-z][a-z-]*\) .*/\1/p'); do page "fxdyn-$verb" "$verb"; done
