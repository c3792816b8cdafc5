# The table of boards.txt.
set(FXDYN_BOARD_TABLE ${CMAKE_CURRENT_LIST_DIR}/boards.txt)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${FXDYN_BOARD_TABLE})

# fxdyn_boards(VARIABLE): the lines of all boards, each with single blanks.
function(fxdyn_boards variable)
  file(STRINGS ${FXDYN_BOARD_TABLE} lines REGEX "^[a-z]")
  list(TRANSFORM lines REPLACE "[ \t]+" " ")
  set(${variable} ${lines} PARENT_SCOPE)
endfunction()

# fxdyn_read_board(LINE): board, preset, folder, processor, linker_script, openocd, tests and images (NAME=MAIN,HANDLER..) of it.
macro(fxdyn_read_board line)
  string(REPLACE " " ";" images "${line}")
  foreach(column board preset folder processor linker_script openocd tests)
    list(POP_FRONT images ${column})
  endforeach()
  string(REPLACE "," ";" tests "${tests}")
endmacro()
