# Single-precision FPU.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16)
set(FXDYN_BOARD mps2-an386)
set(FXDYN_LINKER_SCRIPT mps2.ld)
