// MATLAB 7.3, which is HDF5, by libmatio's writer.
#include <gtest/gtest.h>
#include <matio.h>

#include <cmath>
#include <memory>

#include "host_tools/readers/log_reader.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

constexpr std::size_t samples = 3000;

using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

/// Column-major, as MATLAB has it.
std::vector<double> values(std::size_t rows, std::size_t columns, double phase) {
  std::vector<double> out;
  for (std::size_t j = 0; j < columns; ++j)
    for (std::size_t i = 0; i < rows; ++i)
      out.push_back(std::sin(0.01 * static_cast<double>(i) + phase + static_cast<double>(j)));
  return out;
}

std::vector<double> stamps() {
  std::vector<double> out;
  for (std::size_t k = 0; k < samples; ++k) out.push_back(0.002 * static_cast<double>(k));
  return out;
}

Variable matrix(const char* name, std::vector<double> numbers, std::size_t rows) {
  std::size_t dims[] = {rows, numbers.size() / rows};
  return {::Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, numbers.data(), 0), ::Mat_VarFree};
}

class Matlab73 : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::vector<matvar_t*>& variables, bool packed) {
    auto file = test::folder() / name;
    std::filesystem::remove(file);
    mat_t* const mat = ::Mat_CreateVer(file.c_str(), nullptr, MAT_FT_MAT73);
    EXPECT_NE(mat, nullptr);
    for (matvar_t* one : variables)
      EXPECT_EQ(::Mat_VarWrite(mat, one, packed ? MAT_COMPRESSION_ZLIB : MAT_COMPRESSION_NONE), 0);
    ::Mat_Close(mat);
    return file;
  }
  static Log read(const std::filesystem::path& file, const LogFormat& format = {}) {
    return read_log(file, 2, {true, true}, format, {}, {});
  }
  void expect_numbers(const Log& log) const {
    ASSERT_EQ(log.samples(), static_cast<Eigen::Index>(samples));
    const auto q = values(samples, 2, 0), tau = values(samples, 2, 7);
    EXPECT_TRUE(log.q == Eigen::Map<const Eigen::MatrixXd>(q.data(), samples, 2));
    EXPECT_TRUE(log.tau == Eigen::Map<const Eigen::MatrixXd>(tau.data(), samples, 2));
  }
  Variable t_ = matrix("t", stamps(), samples), q_ = matrix("q", values(samples, 2, 0), samples),
           tau_ = matrix("tau", values(samples, 2, 7), samples);
};

TEST_F(Matlab73, PlainVariablesAreRead) {
  for (const bool packed : {false, true}) {
    const auto file = write(packed ? "packed73.mat" : "plain73.mat", {t_.get(), q_.get(), tau_.get()}, packed);
    EXPECT_EQ(reader_of(file).name, "matlab");
    expect_numbers(read(file));
  }
}

TEST_F(Matlab73, AStructIsAGroup) {
  const char* fields[] = {"t", "q", "tau"};
  std::size_t one[] = {1, 1};
  const Variable log(::Mat_VarCreateStruct("run", 2, one, fields, 3), ::Mat_VarFree);
  ::Mat_VarSetStructFieldByName(log.get(), "t", 0, t_.release());
  ::Mat_VarSetStructFieldByName(log.get(), "q", 0, q_.release());
  ::Mat_VarSetStructFieldByName(log.get(), "tau", 0, tau_.release());
  const auto file = write("struct73.mat", {log.get()}, true);
  expect_numbers(read(file));
  EXPECT_EQ(array_columns(file).front().topic, "run");
}

TEST_F(Matlab73, WhatIsNoMatrixIsExplained) {
  std::vector<double> real = values(samples, 2, 0), imaginary = values(samples, 2, 1);
  std::size_t dims[] = {samples, 2};
  mat_complex_split_t both{real.data(), imaginary.data()};
  const Variable complex(::Mat_VarCreate("q", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, &both, MAT_F_COMPLEX),
                         ::Mat_VarFree);
  auto file = write("complex73.mat", {t_.get(), complex.get(), tau_.get()}, false);
  test::expect_refused(file, {"q is complex", "real(q)"}, [&] { read(file); });

  std::size_t one[] = {1, 1};
  const Variable cell(::Mat_VarCreate("q", MAT_C_CELL, MAT_T_CELL, 2, one, nullptr, 0), ::Mat_VarFree);
  ::Mat_VarSetCell(cell.get(), 0, q_.release());
  file = write("cell73.mat", {t_.get(), cell.get(), tau_.get()}, false);
  test::expect_refused(file, {"q is a cell"}, [&] { read(file); });
}

}  // namespace
}  // namespace fxdyn
