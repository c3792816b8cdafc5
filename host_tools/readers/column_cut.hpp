#pragma once

#include <string>
#include <vector>

#include "host_tools/logs/column_layout.hpp"

namespace fxdyn {

/// The rows in the window of a request. What starts or stops recording writes NaN: such rows count neither at the begin
/// nor at the end.
/// @param columns rising stamps [s] first @param names of all columns @param note told what was left out
/// @throws InputError with `where` in front: NaN between numbers
ColumnTable cut_rows(std::vector<std::vector<double>> columns, const std::vector<std::string>& names,
                     const LogRequest& request, const std::string& where, std::string& note);

}  // namespace fxdyn
