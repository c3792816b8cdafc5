# cmake -D WORK=DIR -D OUTPUT=FILE.cpp -P embed.cmake: C++ source with the code that every report's live plots need: uPlot as
# package-lock.json has it, its licence, and live_plots.js. Packages of npm go to WORK. Without npm or its registry the
# build goes on: reports keep their static pictures.
set(here ${CMAKE_CURRENT_LIST_DIR})
set(installed ${WORK}/node_modules/installed.json)
set(complaint)
find_program(npm npm)
file(MAKE_DIRECTORY ${WORK})
file(COPY ${here}/package.json ${here}/package-lock.json ${here}/.npmrc DESTINATION ${WORK})
execute_process(COMMAND ${CMAKE_COMMAND} -E compare_files ${here}/package-lock.json ${installed} RESULT_VARIABLE changed ERROR_QUIET OUTPUT_QUIET)
if(NOT npm)
  set(complaint "npm is missing: run toolchains/setup.sh")
elseif(changed)
  execute_process(COMMAND ${npm} ci --ignore-scripts --no-audit --no-fund --silent --fetch-retries=1 --fetch-timeout=20000
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed TIMEOUT 120)
  if(failed)
    set(complaint "npm can't install the packages of ${here}/package-lock.json: is its registry reachable?")
  else()
    file(COPY_FILE ${here}/package-lock.json ${installed})
  endif()
endif()

set(style)
set(script)
set(licence)
if(complaint)
  message(WARNING "${complaint} Reports of this build have static pictures only. To try again: rm ${OUTPUT}, and build.")
else()
  set(package ${WORK}/node_modules/uplot)
  file(READ ${package}/dist/uPlot.min.css style)
  file(READ ${package}/dist/uPlot.iife.min.js script)
  file(READ ${package}/LICENSE licence)
  file(READ ${package}/package.json description)
  string(JSON version GET "${description}" version)
  # Its first line is an address; name and licence are in the page in full.
  string(REGEX REPLACE "^/\\*![^\n]*\n" "" script "${script}")
  file(READ ${here}/live_plots.js own)
  set(script "/*! uPlot ${version}\n\n${licence}*/\n${script}\n${own}")
endif()
file(WRITE ${OUTPUT} "#include \"host_tools/page/live_plot.hpp\"

namespace fxdyn::page {
const char* const live_style = R\"~embed~(${style})~embed~\";
const char* const live_script = R\"~embed~(${script})~embed~\";
}  // namespace fxdyn::page
")
