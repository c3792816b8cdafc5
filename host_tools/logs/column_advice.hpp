#pragma once

#include <string>
#include <vector>

namespace fxdyn {

/// What to write where a log has no column of that name: what the columns are that it has as many of as the robot has
/// joints, that they count from 0, or the one with the nearest name.
/// @param signal the key of `columns`, as "tau"; @param missing the column's name
std::string column_advice(const std::string& signal, const std::string& missing,
                          const std::vector<std::string>& columns, std::size_t joints);

}  // namespace fxdyn
