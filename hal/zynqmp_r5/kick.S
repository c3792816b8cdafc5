// Runs on a Cortex-A53 and powers Cortex-R5 core 0 on at the image's entry: QEMU 7.2 does not start it by itself. On
// hardware the boot loader does this. PSCI (Arm DEN 0022), function CPU_ON: target, entry point, context.
    .global _start
_start:
    movz w0, #0x0003
    movk w0, #0x8400, lsl #16   // CPU_ON, 32-bit convention
    mov  w1, #4                 // the first R5, after four A53
    movz w2, #0x0010, lsl #16   // entry point 0x00100000
    mov  w3, #0
    smc  #0
0:  wfi
    b    0b
