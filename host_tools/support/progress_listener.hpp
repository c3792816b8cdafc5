#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace fxdyn {

/// Hears of every stage that begins (step 0) and of each step done, whether bars are drawn or not; from the thread that
/// does the step. What it throws ends the work.
using ProgressListener = std::function<void(const std::string& stage, std::size_t step, std::size_t total)>;

/// For the whole process, while no stage runs; empty: nobody listens.
void set_progress_listener(ProgressListener listener);

}  // namespace fxdyn
