# The same for QEMU's model of the controller, and what powers the processor on there.
fxdyn_add_image(fxdyn_node_qemu node_qemu main_zynqmp_r5.cpp ${FXDYN_TABLES})
target_compile_definitions(fxdyn_node_qemu PRIVATE FXDYN_QEMU)
set(kick ${CMAKE_CURRENT_BINARY_DIR}/kick.bin)
add_custom_command(OUTPUT ${kick}
  COMMAND aarch64-linux-gnu-as ${PROJECT_SOURCE_DIR}/hal/zynqmp_r5/kick.S -o kick.o
  COMMAND aarch64-linux-gnu-objcopy -O binary --only-section=.text kick.o ${kick}
  DEPENDS ${PROJECT_SOURCE_DIR}/hal/zynqmp_r5/kick.S VERBATIM)
add_custom_target(fxdyn_kick DEPENDS ${kick})
add_dependencies(fxdyn_node_qemu fxdyn_kick)
