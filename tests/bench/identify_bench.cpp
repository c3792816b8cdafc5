// Identification end to end: six joints, 60 s at 500 Hz, from the CSV to model.json and metrics.json, shapes searched.

#include <benchmark/benchmark.h>

#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/chains.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

void identify_6_joints_60_s_500_hz(benchmark::State& state) {
  const fs::path folder = fs::temp_directory_path() / "fxdyn_bench_identify";
  const std::string robot =
      "[robot]\nurdf = \"" + test::puma560.string() + "\"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n";
  std::string scenario = "seed = 1\n[sensors]\nencoder_bits = 19\ntorque_noise = 0.01\n";
  for (int j = 1; j <= 6; ++j) {
    const std::string head = "[[effect]]\njoint = " + std::to_string(j) + "\nname = ";
    scenario += head + "\"coulomb\"\nparameters = { amplitude = 3.0 }\n";
    scenario += head + "\"viscous\"\nparameters = { coefficient = 2.0 }\n";
  }
  scenario += robot + "acceleration = [10, 10, 10, 20, 20, 20]\n[[log]]\nname = \"a\"\nduration_s = 60\nseed = 1\n";
  write_file(folder / "scenario.toml", scenario);
  simulate(folder / "scenario.toml", folder);
  write_file(folder / "project.toml", robot + "[[log]]\nfile = \"a.csv\"\nrole = \"train\"\n");
  for (auto _ : state) Pipeline(folder / "project.toml", folder / "out").identify();
  fs::remove_all(folder);
}
BENCHMARK(identify_6_joints_60_s_500_hz)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(3);

}  // namespace
}  // namespace fxdyn
