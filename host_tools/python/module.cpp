// fxdyn.stages: the stages that the verbs call, for fxdyn/__init__.py, which says what they are for.

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/effects_json.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/progress_listener.hpp"
#include "host_tools/support/quiet.hpp"
#include "model/version.hpp"

namespace py = pybind11;
namespace fs = std::filesystem;
using namespace fxdyn;

namespace {

/// Ends the work; what Python raised is kept aside, since only who has its lock may hold it.
struct Interrupted {};

/// Calls back into Python from whatever thread does a step. Ctrl-C ends the work at the next step.
class Caller {
 public:
  explicit Caller(py::object callback) : callback_(std::move(callback)) {}

  void operator()(const std::string& stage, std::size_t step, std::size_t total) {
    const py::gil_scoped_acquire lock;
    if (raised_) throw Interrupted();  // other threads are still at work
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (!callback_.is_none()) callback_(stage, step, total);
    } catch (py::error_already_set& error) {
      raised_.emplace(std::move(error));
      throw Interrupted();
    }
  }
  void raise() {
    if (raised_) throw py::error_already_set(*std::exchange(raised_, {}));
  }

 private:
  py::object callback_;
  std::optional<py::error_already_set> raised_;
};

/// One at a time: who listens to the progress is one for the process.
std::mutex working;

/// Without Python's lock, so that its other threads run meanwhile.
template <class Work>
void work_apart(py::object progress, Work&& work) {
  Caller caller(std::move(progress));
  {
    const py::gil_scoped_release release;
    const std::lock_guard one(working);
    struct Listening {
      explicit Listening(Caller& caller) { set_progress_listener(std::ref(caller)); }
      ~Listening() { set_progress_listener({}); }
    } const listening(caller);
    try {
      work();
    } catch (const Interrupted&) {  // NOLINT(bugprone-empty-catch): raised below, with the lock
    }
  }
  caller.raise();
}

void run_stage(const std::string& stage, const fs::path& project, const fs::path& directory, py::object progress) {
  static const std::map<std::string, void (Pipeline::*)()> stages{
      {"identify", &Pipeline::identify},    {"diagnose", &Pipeline::diagnose}, {"train", &Pipeline::train},
      {"export", &Pipeline::export_tables}, {"report", &Pipeline::report},     {"run", &Pipeline::run}};
  const auto make = stages.at(stage);
  work_apart(std::move(progress), [&] {
    Pipeline pipeline(project, directory);
    (pipeline.*make)();
  });
}

/// @returns the file that it wrote
fs::path run_predict(const fs::path& model, const fs::path& log, bool fixed, bool raw, const fs::path& directory) {
  work_apart(py::none(), [&] { predict_log(model, log, {.fixed = fixed, .raw = raw}, directory); });
  return directory / prediction_name(log);
}

std::vector<fs::path> run_simulate(const fs::path& scenario, const fs::path& directory) {
  std::vector<fs::path> logs;
  work_apart(py::none(), [&] { logs = simulate(scenario, directory); });
  return logs;
}

/// Signals of a file by their names; what it does not have is left out.
py::dict read_signals(const fs::path& file, std::size_t joints, const std::map<std::string, std::string>& columns) {
  Log log;
  work_apart(py::none(), [&] {
    const LogFormat format{.columns = columns};
    log = read_log(file, joints, std::vector<bool>(joints, false), format, {}, {}, false);
  });
  py::dict out;
  out["t"] = log.t;
  const auto signals = signals_of(log);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    if (signals[i]->size() > 0) out[signal_names[i]] = *signals[i];
  }
  return out;
}

}  // namespace

PYBIND11_MODULE(stages, module) {
  be_quiet();
  py::register_exception<InputError>(module, "InputError", PyExc_ValueError);
  py::register_exception<DataError>(module, "DataError", PyExc_ValueError);
  module.attr("version") = version;
  module.def("run_stage", &run_stage);
  module.def("predict", &run_predict);
  module.def("simulate", &run_simulate);
  module.def("read_log", &read_signals);
  module.def("effects", [] { return effects_json().dump(); });
}
