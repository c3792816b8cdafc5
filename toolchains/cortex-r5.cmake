# Real-time processor of the Zynq UltraScale+. Integers only, as on the Cortex-M.
set(FXDYN_CPU_FLAGS -mcpu=cortex-r5 -mfloat-abi=soft)
set(FXDYN_BOARD zynqmp_r5)
set(FXDYN_LINKER_SCRIPT zynqmp_r5.ld)
