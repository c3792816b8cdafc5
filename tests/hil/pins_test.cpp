// libgpiod on a chip of gpio-sim, a real gpiochip to all programs, whose far side is files in sysfs: FXDYN_GPIO_CHIP
// its name, FXDYN_GPIO_FAR the directory of the lines (gpio_sim.sh).

#include <gtest/gtest.h>
#include <poll.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <string>

#include "hal/linux/pins.hpp"

namespace fxdyn::hal::linux {
namespace {

const char* chip() { return std::getenv("FXDYN_GPIO_CHIP"); }
std::string far(unsigned line) {
  return std::string(std::getenv("FXDYN_GPIO_FAR")) + "/sim_gpio" + std::to_string(line);
}
void pull(unsigned line, bool up) {
  std::ofstream(far(line) + "/pull") << (up ? "pull-up" : "pull-down") << std::flush;
}
int level(unsigned line) {
  int value = -1;
  std::ifstream(far(line) + "/value") >> value;
  return value;
}

TEST(Pins, OutputReachesTheFarSide) {
  OutputPin pin;
  ASSERT_EQ(pin.open(chip(), 1, "fault"), Status::ok);
  EXPECT_EQ(level(1), 0);
  ASSERT_EQ(pin.set(true), Status::ok);
  EXPECT_EQ(level(1), 1);
  ASSERT_EQ(pin.set(false), Status::ok);
  EXPECT_EQ(level(1), 0);
}

TEST(Pins, AFaultLineIsAssertedBeforeAnybodySetsIt) {
  OutputPin pin;
  ASSERT_EQ(pin.open(chip(), 1, "fault", Polarity::active_low, AtStart::on), Status::ok);
  EXPECT_EQ(level(1), 0);
  ASSERT_EQ(pin.set(false), Status::ok);
  EXPECT_EQ(level(1), 1);
}

TEST(Pins, PolarityIsThePins) {
  OutputPin out;
  InputPin in;
  ASSERT_EQ(out.open(chip(), 1, "fault", Polarity::active_low), Status::ok);
  EXPECT_EQ(level(1), 1) << "not asserted";
  ASSERT_EQ(out.set(true), Status::ok);
  EXPECT_EQ(level(1), 0);
  pull(0, true);
  ASSERT_EQ(in.open(chip(), 0, "enable", Polarity::active_low), Status::ok);
  bool on = true;
  ASSERT_EQ(in.read(on), Status::ok);
  EXPECT_FALSE(on);
}

TEST(Pins, InputAndItsEdges) {
  pull(0, false);
  InputPin pin;
  ASSERT_EQ(pin.open(chip(), 0, "enable"), Status::ok);
  bool on = true;
  ASSERT_EQ(pin.read(on), Status::ok);
  EXPECT_FALSE(on);
  EXPECT_EQ(pin.events(), 0U);
  pull(0, true);
  pollfd wait{pin.descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&wait, 1, 1000), 1);
  ASSERT_EQ(pin.read(on), Status::ok);
  EXPECT_TRUE(on);
  pull(0, false);
  ASSERT_EQ(pin.read(on), Status::ok);
  EXPECT_FALSE(on);
  EXPECT_EQ(pin.events(), 2U);
}

TEST(Pins, OpeningErrors) {
  OutputPin none, no_line, one, two;
  EXPECT_EQ(none.open("gpiochip99", 0, "x"), Status::failed);
  EXPECT_EQ(errno, ENOENT);
  EXPECT_EQ(no_line.open(chip(), 99, "x"), Status::failed);
  EXPECT_EQ(errno, EINVAL);
  ASSERT_EQ(one.open(chip(), 2, "one"), Status::ok);
  EXPECT_EQ(two.open(chip(), 2, "two"), Status::failed);
  EXPECT_EQ(errno, EBUSY);
  EXPECT_EQ(none.set(true), Status::failed);
  InputPin input;
  bool on = true;
  EXPECT_EQ(input.read(on), Status::failed);
  EXPECT_TRUE(on) << "keeps its value";
}

}  // namespace
}  // namespace fxdyn::hal::linux
