#include <benchmark/benchmark.h>

#include "host_tools/support/heap.hpp"

/// Memory is kept as in the program that users run; the peers profit as well.
int main(int argc, char** argv) {
  fxdyn::keep_freed_memory();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
