#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/exchange/simple_robot.hpp"

namespace fxdyn {

/// A chain as libsdformat reads it.
struct SdfRobot {
  std::vector<Joint> joints;  ///< the frame of a joint and of its link is the link's; axis and inertial in it
  std::vector<SimpleJoint> said;
};

/// A file whose joints are the given ones, each on the link of the one before it, the first on the world.
/// It is a library of its own, opened where an SDF is read back: libsdformat would cost every start of fxdyn 60 ms.
/// @throws DataError: libsdformat refuses the file, or it holds another chain
using ReadSdf = void(const std::filesystem::path& file, const std::vector<std::string>& joints, SdfRobot& out);
inline constexpr const char* sdf_reader_library = "libfxdyn_sdf_reader.so";
inline constexpr const char* sdf_reader_function = "fxdyn_read_sdf";

}  // namespace fxdyn
