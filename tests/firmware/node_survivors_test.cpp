// What mutants of the drive node lived on.

#include <gtest/gtest.h>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using test::Bench;
using test::Bytes;

Abort abort_of(const Bytes& answer) {
  return answer[0] == 0x80 ? static_cast<Abort>(canopen::load<4>(&answer[4])) : Abort::none;
}

// A number of 2 bytes in segments of 7: the first one is refused, not only the last.
TEST(NodeSurvivors, ASegmentThatOverflowsIsRefusedAtOnce) {
  Bench<> bench;
  bench.poll();
  const auto answer_to = [&](const Bytes& request) {
    bench.send(canopen::sdo_request_id + bench.node.id(), request);
    bench.poll();
    const auto answers = bench.heard(canopen::sdo_answer_id + bench.node.id());
    EXPECT_EQ(answers.size(), 1U);
    return answers.at(0);
  };
  EXPECT_EQ(abort_of(answer_to({0x20, 0x10, 0x20, 0, 0, 0, 0, 0})), Abort::none) << "0x2010, its size not told";
  EXPECT_EQ(abort_of(answer_to({0x00, 1, 2, 3, 4, 5, 6, 7})), Abort::too_long) << "seven bytes, and more to come";
}

TEST(NodeSurvivors, TheMostOfACostStaysWhereTheNextOneIsLess) {
  Bench<> bench;
  bench.start();
  std::size_t k = 0;
  while (k < 20) bench.tick(test::motion(k++));
  const std::uint32_t most_model = bench.read(0x2002, 2), most = bench.read(0x2002, 4);
  bench.on_wire.counter.start_over();
  bench.tick(test::motion(k++));
  EXPECT_LT(bench.read(0x2002, 1), most_model);
  EXPECT_EQ(bench.read(0x2002, 2), most_model);
  EXPECT_LT(bench.read(0x2002, 3), most);
  EXPECT_EQ(bench.read(0x2002, 4), most);
}

}  // namespace
}  // namespace fxdyn
