set(FXDYN_DATA_BIT_RATE 2000000 CACHE STRING "bit/s in the data phase of CAN FD frames: 2000000 or 4000000")
target_compile_definitions(fxdyn_node PRIVATE FXDYN_DATA_BIT_RATE=${FXDYN_DATA_BIT_RATE})
