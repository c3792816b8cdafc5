// Compiled for the headers that tests/CMakeLists.txt precompiles with it.
