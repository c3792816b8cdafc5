# fxdyn_add_linux_node(TARGET TABLES.hpp): the drive node as a Linux process.
function(fxdyn_add_linux_node target tables)
  add_executable(${target} ${PROJECT_SOURCE_DIR}/firmware/main_linux.cpp)
  target_compile_definitions(${target} PRIVATE FXDYN_TABLES_HEADER="${tables}")
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE fxdyn_hal_linux fxdyn_hal_gpiod fxdyn_warnings)
endfunction()
