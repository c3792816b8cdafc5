# No FPU.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m3 -mfloat-abi=soft)
set(FXDYN_BOARD mps2-an385)
set(FXDYN_LINKER_SCRIPT mps2.ld)
