# A drive controller with CAN FD. Integers only, see cortex-m4.cmake.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m4 -mfloat-abi=soft)
set(FXDYN_BOARD stm32g474)
set(FXDYN_BOARD_FAMILY stm32g4)
set(FXDYN_LINKER_SCRIPT stm32g474.ld)
set(FXDYN_OPENOCD_CONFIGURATION -f interface/stlink.cfg -f target/stm32g4x.cfg)
