// pages DIR: writes into DIR what may be flashed over the golden tables without a rebuild, other.bin (other numbers,
// whole) and damaged.bin (one bit wrong); says the checksums of the torques of the golden tables and of other.bin. The
// torques of other.bin are computed from the file's bytes, of which no compiler knows anything.

#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "tables.hpp"
#include "vectors.hpp"

namespace {

using fxdyn::tables::Model;
using Page = fxdyn::TablePage<Model>;
namespace golden = fxdyn::golden;

std::uint32_t checksum(const Page& page) {
  fxdyn::Crc32 crc;
  const auto* words = reinterpret_cast<const std::uint32_t*>(&page.parameters);
  for (std::size_t i = 0; i < Page::parameter_words; ++i) crc.add(words[i]);
  return crc.value();
}

/// Half the gravity, and of every number behind the links' geometry another lowest bit.
Page other_numbers() {
  Page page = fxdyn::tables::page;
  for (auto* gravity : {&page.parameters.up.x, &page.parameters.up.y, &page.parameters.up.z}) gravity->raw /= 2;
  auto* word = reinterpret_cast<std::int32_t*>(&page.parameters.inertia);
  const auto* end = reinterpret_cast<const std::int32_t*>(&page + 1);
  for (; word != end; ++word) *word ^= 1;
  page.header.crc32 = checksum(page);
  page.header = fxdyn::with_check(page.header);
  return page;
}

std::vector<char> bytes_of(const Page& page) {
  std::vector<char> bytes(sizeof page);
  std::memcpy(bytes.data(), &page, sizeof page);
  return bytes;
}

void write(const std::string& file, const Page& page) {
  const std::vector<char> bytes = bytes_of(page);
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

std::uint32_t torques_of(const Page& page) {
  Model::State state;
  fxdyn::Saturations saturations;
  fxdyn::Crc32 crc;
  const std::int32_t* in = golden::setpoints.data();
  for (std::size_t tick = 0; tick < golden::ticks; ++tick) {
    if (tick % golden::ticks_per_run == 0) state = {};
    Model::Setpoints setpoints;
    for (int joint = 0; joint < static_cast<int>(Model::joints); ++joint) {
      setpoints.q[joint].raw = *in++;
      setpoints.dq[joint].raw = *in++;
      setpoints.ddq[joint].raw = *in++;
    }
    for (const auto torque : Model::tick(page.parameters, state, setpoints, saturations))
      crc.add(static_cast<std::uint32_t>(torque.raw));
  }
  return crc.value();
}

/// Of the golden vectors themselves.
std::uint32_t golden_torques() {
  fxdyn::Crc32 crc;
  for (const std::int32_t torque : golden::torques) crc.add(static_cast<std::uint32_t>(torque));
  return crc.value();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::string directory = argv[1];
  const Page other = other_numbers();
  Page damaged = other;
  damaged.parameters.words[0] ^= 1 << 9;
  if (!fxdyn::page_is_valid(other) || fxdyn::page_is_valid(damaged)) {
    std::fputs("pages: made a page that is not what it is meant to be\n", stderr);
    return 1;
  }
  write(directory + "/other.bin", other);
  write(directory + "/damaged.bin", damaged);
  std::printf("golden %u\nother %u\n", golden_torques(), torques_of(other));
}
