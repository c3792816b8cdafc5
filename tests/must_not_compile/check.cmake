# cmake -DCOMPILER=.. -DCASE=x.cpp -DINCLUDES=a;b -P check.cmake: the case compiles with -DFXDYN_OK; without it, it does not,
# and the compiler says what the case's first line expects ("// expect: text").
file(STRINGS ${CASE} first_line LIMIT_COUNT 1)
if(NOT first_line MATCHES "^// expect: (.+)$")
  message(FATAL_ERROR "${CASE}: the first line must say what is expected")
endif()
set(expected "${CMAKE_MATCH_1}")
list(TRANSFORM INCLUDES PREPEND -I)
set(compile ${COMPILER} -std=c++20 -fsyntax-only -fno-diagnostics-color ${INCLUDES})
set(ENV{LC_ALL} C)  # quotation marks in ASCII

execute_process(COMMAND ${compile} -DFXDYN_OK ${CASE} RESULT_VARIABLE result ERROR_VARIABLE said)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "does not compile even without the offending line:\n${said}")
endif()
execute_process(COMMAND ${compile} ${CASE} RESULT_VARIABLE result ERROR_VARIABLE said)
if(result EQUAL 0)
  message(FATAL_ERROR "compiles, and must not")
endif()
string(FIND "${said}" "${expected}" at)
if(at LESS 0)
  message(FATAL_ERROR "does not compile, but the compiler does not say \"${expected}\":\n${said}")
endif()
