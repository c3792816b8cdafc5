#pragma once

#include <Eigen/Dense>
#include <string>

namespace fxdyn {

/// As the content of an element.
std::string escaped(const std::string& text);
/// As an attribute's value, with its quotes.
std::string quoted(const std::string& text);
/// "x y z", so that they are read back as they are.
std::string numbers(const Eigen::Vector3d& v);

}  // namespace fxdyn
