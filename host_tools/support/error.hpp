#pragma once

#include <stdexcept>

namespace fxdyn {

/// Bad input or usage: a file, line, joint or key is wrong. The message is one line and says what to do. Exit code 2.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The input is well formed, but the data can't support the answer (a joint never moves, too few samples). Exit code 1.
struct DataError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace fxdyn
