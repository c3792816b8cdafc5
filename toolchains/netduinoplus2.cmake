# STM32F405, which QEMU has a machine for: the image that boots as a .bin from flash. Integers only, see cortex-m4.cmake.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m4 -mfloat-abi=soft)
set(FXDYN_BOARD netduinoplus2)
set(FXDYN_BOARD_FAMILY stm32f4)
set(FXDYN_LINKER_SCRIPT netduinoplus2.ld)
set(FXDYN_OPENOCD_CONFIGURATION -f interface/stlink.cfg -f target/stm32f4x.cfg)
