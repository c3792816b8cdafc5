#pragma once

#include <filesystem>
#include <string>

#include "host_tools/excite/next_motion.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// What a diagnosis left open, and the model that does not answer it: without the effects in question. Likely effects
/// against their rival, or against nothing; of undecided sets each member against the first; what these logs can't
/// identify, as large as 1 % of rated torque; places of joints that are unexplained.
/// Joints that hardly moved, and gaps that have no place in the motion, are sentences of their own.
OpenQuestions open_questions(const DiagnosisResult& diagnosis, IdentifiedModel& model);

/// `fxdyn excite PROJECT --after DIR`: plans the motions that decide what the diagnosis in `after` left open. Writes
/// <name>.csv, <name>.svg and excite.json to `directory`; returns the table for the terminal.
/// @throws InputError: no diagnosis in `after`, or one of another project; DataError: it left nothing open
std::string excite_after(const Project& project, const std::filesystem::path& after,
                         const std::filesystem::path& directory, Progress& progress);

}  // namespace fxdyn
