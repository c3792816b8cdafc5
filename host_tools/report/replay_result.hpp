#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fxdyn {

/// What firmware did with one log.
struct ReplayedLog {
  struct Joint {
    std::string name, unit;
    std::size_t index = 0;                                 ///< from 1
    double largest_error = 0, largest_error_of_rated = 0;  ///< |firmware - double| [N*m | N, -]
  };
  std::string name;
  std::int64_t ticks = 0, different_ticks = 0;
  std::uint64_t saturations = 0;
  std::uint32_t fewest = 0, most = 0;  ///< instructions a tick
  double mean = 0;
  std::vector<Joint> joints;
};

/// Of an image, as its build says it in size.json [byte].
struct ImageSize {
  std::int64_t flash = 0;
  std::int64_t ram = 0;  ///< stack included
  std::int64_t stack = 0;
};
nlohmann::json to_json(const ImageSize& size);
ImageSize image_size_of(const nlohmann::json& file);

/// Content of replay.json.
struct ReplayResult {
  std::string image;
  std::uint32_t tables_crc = 0;
  std::vector<std::size_t> output_joints;  ///< from 1
  std::string tables_in;                   ///< "image" or "update slot"
  std::vector<ReplayedLog> logs;
  std::optional<ImageSize> size;  ///< of the image; none: not known

  /// Every torque and every saturation is the host's.
  bool bit_exact() const;
};
nlohmann::json to_json(const ReplayResult& result);
ReplayResult replay_of(const nlohmann::json& file);

}  // namespace fxdyn
