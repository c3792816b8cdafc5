# Bare-metal Arm. -DFXDYN_CPU=cortex-m4 chooses the processor (one file each next to this one).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES FXDYN_CPU)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

if(NOT FXDYN_CPU OR NOT EXISTS ${CMAKE_CURRENT_LIST_DIR}/${FXDYN_CPU}.cmake)
  message(FATAL_ERROR "set FXDYN_CPU to one of the processors or boards next to this file, e.g. cortex-m4")
endif()
include(${CMAKE_CURRENT_LIST_DIR}/${FXDYN_CPU}.cmake)  # FXDYN_CPU_FLAGS, FXDYN_BOARD, FXDYN_LINKER_SCRIPT
if(NOT FXDYN_BOARD_FAMILY)  # the folder in hal/
  string(REGEX REPLACE "-.*" "" FXDYN_BOARD_FAMILY ${FXDYN_BOARD})
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
