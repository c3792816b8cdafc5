# Double-precision FPU.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16)
set(FXDYN_BOARD mps2-an500)
set(FXDYN_LINKER_SCRIPT mps2.ld)
