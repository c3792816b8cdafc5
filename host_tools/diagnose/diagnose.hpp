#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn {

struct Diagnosis {
  IdentifiedModel nominal;  ///< base parameters and nominal effects (what a healthy session has beside them too)
  IdentifiedModel model;    ///< with the effects that were named
  DiagnosisResult report;
  std::vector<bool> still;  ///< joints that stand still: neither model has anything of their own
};

/// What becomes of a model that was found, as a model of possible bodies.
/// @param logs those that it was made from
using FinishModel = std::function<IdentifiedModel(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs)>;

/// Finds what the nominal model lacks, names it, adds it, and says what that is worth on logs that decided nothing.
/// docs/guide/diagnosis.md explains the rules.
/// @param data train and validate logs @param baseline a healthy session, role train, filtered alike; may be empty
/// @param test read for the figures only; but their sampling step, like that of all logs, bounds a delay
/// @param options its thresholds
/// @param finish of both models, before they are judged; empty: they stay as they are. Where a joint stands still they
/// do in any case: these logs tell no bodies
/// @throws DataError: logs with too little information, a baseline that can't be the same robot's
Diagnosis diagnose(const Project& project, GateData& data, const std::vector<ProcessedLog>& baseline,
                   const std::vector<ProcessedLog>& test, Progress& progress, const diagnosis::Options& options = {},
                   const FinishModel& finish = {});

}  // namespace fxdyn
