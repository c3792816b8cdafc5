#include "host_tools/arrays/apart.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

TEST(ReadApart, PiecesArriveInTheirOrder) {
  const auto file = test::write("some.bin", "bytes");
  const std::string big(5'000'000, 'x');
  std::vector<std::string> got;
  read_apart(
      file,
      [&](const SendPiece& send) {
        send("first");
        send("");
        send(big);
      },
      [&](std::string_view piece) { got.emplace_back(piece); });
  ASSERT_EQ(got.size(), 3U);
  EXPECT_EQ(got[0], "first");
  EXPECT_EQ(got[1], "");
  EXPECT_EQ(got[2], big);
}

TEST(ReadApart, ComplaintsComeBack) {
  const auto file = test::write("some.bin", "bytes");
  test::expect_refused(file, {"no t in it"}, [&] {
    read_apart(
        file, [&](const SendPiece&) { throw InputError(file.string() + ": no t in it"); }, [](auto) {});
  });
}

TEST(ReadApart, WhatGoesAstrayIsADamagedFile) {
  const auto file = test::write("some.bin", "bytes");
  const auto refused = [&](const std::function<void(const SendPiece&)>& work) {
    test::expect_refused(file, {"is damaged: copy it again"}, [&] { read_apart(file, work, [](auto) {}); });
  };
  refused([](const SendPiece&) { ::raise(SIGSEGV); });
  refused([](const SendPiece&) { ::_exit(0); });
  refused([](const SendPiece& send) {
    send("half");
    ::raise(SIGKILL);
  });
  refused([](const SendPiece&) { throw std::bad_alloc(); });
}

TEST(ReadApart, ItsWordsAndItsEndlessLoopsAreNobodysElse) {
  const auto file = test::write("some.bin", "bytes");
  testing::internal::CaptureStderr();
  test::expect_refused(file, {"is damaged"}, [&] {
    read_apart(
        file,
        [](const SendPiece&) {
          std::fputs("HDF5-DIAG: error\n", stderr);
          volatile bool on = true;
          while (on) {}
        },
        [](auto) {});
  });
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(ReadApart, AnErrorOfWhoListensEndsIt) {
  const auto file = test::write("some.bin", "bytes");
  EXPECT_THROW(read_apart(
                   file,
                   [](const SendPiece& send) {
                     for (;;) send("again");
                   },
                   [](auto) { throw InputError("enough"); }),
               InputError);
  EXPECT_THROW(read_apart(
                   "no/such.file", [](const SendPiece&) {}, [](auto) {}),
               InputError);
}

}  // namespace
}  // namespace fxdyn
