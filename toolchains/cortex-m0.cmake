# No FPU, no 64-bit product: the compiler's library multiplies.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m0 -mfloat-abi=soft)
set(FXDYN_BOARD microbit)
set(FXDYN_LINKER_SCRIPT microbit.ld)
