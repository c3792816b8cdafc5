# Single-precision FPU.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m33 -mfloat-abi=hard -mfpu=fpv5-sp-d16)
set(FXDYN_BOARD mps2-an505)
set(FXDYN_LINKER_SCRIPT mps2-an505.ld)
