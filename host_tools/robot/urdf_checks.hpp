#pragma once

#include <string>

class TiXmlDocument;
class TiXmlElement;

namespace fxdyn {

/// The <robot> of a URDF, looked at before urdfdom reads it: urdfdom knows no line numbers, and takes millimetres,
/// degrees and kg mm^2 as they are.
/// @throws InputError with file, line and joint or link: another format (xacro, SRDF, SDF, MJCF), a joint without the
/// limits that its type needs, numbers that no robot in m, rad and kg has
void check_urdf(const TiXmlDocument& document, const std::string& file);

/// Kinematics are enough: <limit> without effort or velocity gets zeros, "not known"; whether there were any.
bool complete_limits(TiXmlDocument& document);

}  // namespace fxdyn
