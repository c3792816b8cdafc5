# fxdyn_add_image(TARGET NAME SOURCE TABLES.hpp [INTERRUPT_HANDLER..]): an image NAME-<board>.elf, .bin and .hex for the
# board of the toolchain file, with its map and, if it passes the checks after linking, its size.json.
function(fxdyn_add_image target name source tables)
  add_executable(${target} ${source})
  set(linker_script ${FXDYN_LINKER_DIRECTORY}/${FXDYN_LINKER_SCRIPT})
  set_target_properties(${target} PROPERTIES
    OUTPUT_NAME ${name}-${FXDYN_BOARD} SUFFIX .elf
    LINK_DEPENDS "${linker_script};${FXDYN_LINKER_DIRECTORY}/sections.ld")
  target_compile_definitions(${target} PRIVATE FXDYN_TABLES_HEADER="${tables}" FXDYN_BOARD_NAME="${FXDYN_BOARD}")
  target_compile_options(${target} PRIVATE -fcallgraph-info=su,da)
  target_link_libraries(${target} PRIVATE fxdyn_board fxdyn_warnings)
  target_link_options(${target} PRIVATE
    -L${FXDYN_LINKER_DIRECTORY} -T${linker_script}
    -Wl,-Map=$<TARGET_FILE_DIR:${target}>/${name}-${FXDYN_BOARD}.map -Wl,--print-memory-usage)
  string(REGEX REPLACE "nm$" "" binutils ${CMAKE_NM})
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND ${CMAKE_OBJCOPY} -O binary $<TARGET_FILE:${target}> $<TARGET_FILE_DIR:${target}>/${name}-${FXDYN_BOARD}.bin
    COMMAND ${CMAKE_OBJCOPY} -O ihex $<TARGET_FILE:${target}> $<TARGET_FILE_DIR:${target}>/${name}-${FXDYN_BOARD}.hex
    COMMAND ${PROJECT_SOURCE_DIR}/toolchains/finish_image.sh ${binutils} $<TARGET_FILE:${target}>
      ${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${target}.dir ${PROJECT_BINARY_DIR}/hal/CMakeFiles/fxdyn_board.dir
      -- reset_handler fault_handler ${ARGN}
    VERBATIM)
endfunction()
