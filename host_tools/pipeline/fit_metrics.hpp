#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/project/project.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/metrics_result.hpp"

namespace fxdyn {

struct FitFigures;
struct WeakParameter;

/// Errors, what a fit decided, and how well it knows its parameters.
/// `stages`: from the rigid body to the model itself.
MetricsResult fit_metrics(const Project& project, const Fitter& fitter, const FitFigures& estimate,
                          const std::vector<std::string>& notes, const std::vector<StageErrors>& stages);

/// Adds what the model that diagnosis started from errs on what judges.
/// @param stages their errors on all logs @param nominal file of that model; not there: they stay without
void add_friction_errors(std::vector<GateErrors>& errors, Fitter fitter, const std::vector<StageErrors>& stages,
                         const std::filesystem::path& nominal);

/// For people: which parameters these logs determine poorly and what to move; empty: none.
std::string weak_note(const std::vector<WeakParameter>& weak, const Robot& robot);

}  // namespace fxdyn
