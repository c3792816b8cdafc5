#!/usr/bin/env bash
# fake_program.sh VERB PROJECT --out DIR: writes what another run of fxdyn wrote (FAKE_RESULTS), and behaves as the name of
# the project says. The test's fleets need robots that end when the test wants it.
project=$2 out=$4
case $project in
  *slow*) sleep 1000 & sleep 1000 ;;
  *memory*) exec python3 -c 'x = bytearray(1 << 32)' ;;
  *silent*) exit 3 ;;
  *crash*) kill -SEGV $$ ;;
  *nothing*) exit 0 ;;
  *other*) mkdir -p "$out" && echo '{"a": 1}' >"$out/model.json" && exit 0 ;;
esac
echo "$project" >>"$FAKE_RESULTS.calls"
mkdir -p "$out"
[ -z "$FAKE_SECONDS" ] || sleep "$FAKE_SECONDS"
cp "$FAKE_RESULTS"/*.json "$out"
