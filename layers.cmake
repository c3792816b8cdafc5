# Links are arrows: what a library does not link, it cannot include.

# fxdyn_visible(VARIABLE FOLDER): an include directory in which nothing but FOLDER is, under its name from the root.
function(fxdyn_visible variable folder)
  string(REPLACE / - name ${folder})
  set(root ${PROJECT_BINARY_DIR}/visible/${name})
  cmake_path(GET folder PARENT_PATH parent)
  file(MAKE_DIRECTORY ${root}/${parent})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${folder} ${root}/${folder} SYMBOLIC)
  set(${variable} ${root} PARENT_SCOPE)
endfunction()

# fxdyn_alone(file...): these files keep names for themselves that files beside them use too, so they are not compiled in
# one go with those (CMAKE_UNITY_BUILD, which halves a build with sanitizers).
function(fxdyn_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# fxdyn_layer(NAME [SOURCES file...] [LINKS target...] [PRIVATE target...]): the library fxdyn_NAME of host_tools/NAME.
# It sees the headers of LINKS and of what those link; whoever links it sees them too. PRIVATE ones are its own.
function(fxdyn_layer name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES;LINKS;PRIVATE")
  fxdyn_visible(visible host_tools/${name})
  if(NOT ARG_SOURCES)
    add_library(fxdyn_${name} INTERFACE)
    target_include_directories(fxdyn_${name} INTERFACE ${visible})
    target_link_libraries(fxdyn_${name} INTERFACE ${ARG_LINKS})
    return()
  endif()
  add_library(fxdyn_${name} STATIC ${ARG_SOURCES})
  target_include_directories(fxdyn_${name} PUBLIC ${visible})
  target_link_libraries(fxdyn_${name} PUBLIC ${ARG_LINKS} PRIVATE fxdyn_warnings ${ARG_PRIVATE})
  # The heavy headers are read once instead of in every file: half the build time. One such file for all libraries.
  if(name STREQUAL support)
    target_precompile_headers(fxdyn_support PRIVATE <Eigen/Dense> <fmt/format.h> <nlohmann/json.hpp> <filesystem> <functional> <optional> <string> <vector>)
  else()
    target_precompile_headers(fxdyn_${name} REUSE_FROM fxdyn_support)
  endif()
endfunction()
