# Every header that can go into a firmware compiles alone: one generated source file each.
file(GLOB headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}
  ${PROJECT_SOURCE_DIR}/model/*.hpp ${PROJECT_SOURCE_DIR}/model/effects/*.hpp
  ${PROJECT_SOURCE_DIR}/hal/*.hpp ${PROJECT_SOURCE_DIR}/hal/mps2/*.hpp ${PROJECT_SOURCE_DIR}/firmware/*.hpp)
set(sources)
foreach(header ${headers})
  string(MAKE_C_IDENTIFIER ${header} name)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/header_check/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n")
  list(APPEND sources ${source})
endforeach()
add_library(fxdyn_header_check OBJECT ${sources})
target_link_libraries(fxdyn_header_check PRIVATE fxdyn_board fxdyn_warnings)
