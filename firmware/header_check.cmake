# Every header that can go into a firmware compiles alone: one generated source file each. With FXDYN_HEADERS_TOGETHER only
# those of the board do, and all others at once: that they compile alone is no matter of the target.
option(FXDYN_HEADERS_TOGETHER "the header check compiles all but the board's headers at once" OFF)
file(GLOB headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}
  ${PROJECT_SOURCE_DIR}/model/*.hpp ${PROJECT_SOURCE_DIR}/model/effects/*.hpp
  ${PROJECT_SOURCE_DIR}/hal/*.hpp ${PROJECT_SOURCE_DIR}/firmware/*.hpp
  ${PROJECT_SOURCE_DIR}/hal/${FXDYN_BOARD_FAMILY}/*.hpp)
if(FXDYN_BOARD_FAMILY MATCHES "^stm32")
  file(GLOB common CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/hal/stm32/*.hpp)
  list(APPEND headers ${common})
endif()
set(sources)
set(of_board)
foreach(header ${headers})
  string(MAKE_C_IDENTIFIER ${header} name)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/header_check/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n")
  list(APPEND sources ${source})
  if(header MATCHES "^hal/.*/")
    list(APPEND of_board ${source})
  endif()
endforeach()
add_library(fxdyn_header_check OBJECT ${sources})
target_link_libraries(fxdyn_header_check PRIVATE fxdyn_board fxdyn_warnings)
set_target_properties(fxdyn_header_check PROPERTIES UNITY_BUILD ${FXDYN_HEADERS_TOGETHER} UNITY_BUILD_BATCH_SIZE 0)
set_source_files_properties(${of_board} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
