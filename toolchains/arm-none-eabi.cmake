# Bare-metal Arm. -DFXDYN_CPU=cortex-m4 chooses the processor and its board: a preset of boards.txt.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES FXDYN_CPU)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

include(${CMAKE_CURRENT_LIST_DIR}/boards.cmake)
# fxdyn_choose_board(PRESET): what its line says, in FXDYN_BOARD..; nothing where there is none.
function(fxdyn_choose_board wanted)
  fxdyn_boards(lines)
  foreach(line ${lines})
    fxdyn_read_board("${line}")
    if(preset STREQUAL wanted)
      set(FXDYN_BOARD ${board} PARENT_SCOPE)
      set(FXDYN_BOARD_FAMILY ${folder} PARENT_SCOPE)  # in hal/
      set(FXDYN_BOARD_IMAGES ${images} PARENT_SCOPE)
      set(FXDYN_LINKER_SCRIPT ${linker_script} PARENT_SCOPE)
      # The library computes in integers only. Without the FPU the compiler can't park integers in its registers either, which
      # interrupts would have to save; a firmware of your own that needs it sets its own float ABI.
      set(FXDYN_CPU_FLAGS -mcpu=${processor} -mfloat-abi=soft PARENT_SCOPE)
      if(NOT openocd STREQUAL -)
        set(FXDYN_OPENOCD_CONFIGURATION -f interface/stlink.cfg -f target/${openocd}.cfg PARENT_SCOPE)
      endif()
    endif()
  endforeach()
endfunction()
fxdyn_choose_board("${FXDYN_CPU}")
if(NOT FXDYN_BOARD)
  message(FATAL_ERROR "set FXDYN_CPU to a preset of ${FXDYN_BOARD_TABLE}, e.g. cortex-m4")
endif()

set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(FXDYN_LINKER_DIRECTORY ${CMAKE_CURRENT_LIST_DIR}/linker)

# No exceptions, no run-time types, no guards for static locals: nothing that pulls in the heap.
string(JOIN " " CMAKE_CXX_FLAGS_INIT
  ${FXDYN_CPU_FLAGS} -mthumb -ffreestanding -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit
  -ffunction-sections -fdata-sections -Wno-psabi --specs=nano.specs)
# The cache variable itself: to the _INIT one CMake would append its own -O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O2" CACHE STRING "Flags of release builds")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-nostartfiles -Wl,--gc-sections,--no-warn-rwx-segments,--fatal-warnings")

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
