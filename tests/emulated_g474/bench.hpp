#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <stdexcept>

#include "tests/emulated_g474/host.hpp"

namespace fxdyn::emulated {

/// The image that a board executes: built once, by the fixture that the tests require.
inline const Image& node_image() {
  static const Image image = [] {
    const char* path = std::getenv("FXDYN_G474_ELF");
    if (path == nullptr) throw std::runtime_error("FXDYN_G474_ELF names the image: node-stm32g474.elf");
    return Image::load(path);
  }();
  return image;
}

/// A host and a board with the node's image.
class Bench : public Host {
 public:
  explicit Bench(Oscillators oscillators = {}, std::uint32_t garbage = 1) : Host(node_image(), oscillators, garbage) {}

  /// Operational, without a ramp: torques are the model's from the first tick on.
  void start() {
    ASSERT_TRUE(boot());
    ASSERT_TRUE(write(0x2010, 0, 0, 2));
    nmt(canopen::NmtCommand::start);
    heard();
  }

  /// Nothing that the manual forbids, no fault, nothing written that is not the image's.
  void expect_clean() {
    for (const std::string& what : board.take_violations()) ADD_FAILURE() << what;
    for (const auto& fault : board.core.faults()) ADD_FAILURE() << fault.what << " at " << std::hex << fault.pc;
    EXPECT_FALSE(board.core.locked_up());
    const Address end = node_image().symbol("fxdyn_bss_end"), kept = node_image().symbol("fxdyn_kept");
    EXPECT_EQ(board.lowest_written(end, kept), kept) << "wrote above its data";
  }
};

}  // namespace fxdyn::emulated
