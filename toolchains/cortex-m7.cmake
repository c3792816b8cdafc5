# The library computes in integers only. Without the FPU the compiler can't park integers in its registers either, which
# interrupts would have to save; a firmware of your own that needs it sets its own float ABI.
set(FXDYN_CPU_FLAGS -mcpu=cortex-m7 -mfloat-abi=soft)
set(FXDYN_BOARD mps2-an500)
set(FXDYN_LINKER_SCRIPT mps2.ld)
