#!/usr/bin/env bash
# failed_test.sh FOLDER: what failed.py shows of a run of ctest in which some tests pass, fail, have no output or no program.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
rm -rf "$1" && mkdir -p "$1" && cd "$1"
cat >CTestTestfile.cmake <<'END'
add_test(good "echo" "good")
add_test(bad "bash" "-c" "seq 1 30; exit 3")
add_test(silent "false")
add_test(absent "/nonexistent/program")
add_test(slow "bash" "-c" "echo begun; sleep 60")
set_tests_properties(slow PROPERTIES TIMEOUT 1)
END
ctest >/dev/null 2>&1 && { echo "no test failed" >&2; exit 1; }
"$here/failed.py" . >shown.txt
diff - shown.txt <<END

--- failed: bad
$(seq 11 30)

--- failed: silent

--- failed: absent
Unable to find executable: /nonexistent/program

--- failed: slow
begun
END
