#include "host_tools/bytes/foreign_format.hpp"

#include <algorithm>
#include <array>

namespace fxdyn {
namespace {

using namespace std::string_view_literals;

struct Format {
  std::string_view magic;  ///< the file's first bytes
  const char* words;
};

constexpr std::array formats{
    Format{"PK\x03\x04"sv, "is a spreadsheet (xlsx, ods) or another zip archive: save it as CSV, or unzip it"},
    Format{"\xD0\xCF\x11\xE0"sv, "is an old spreadsheet (xls): save it as CSV"},
    Format{"PAR1"sv, "is Parquet: name its file unpacked, it can't come through a pipe"},
    Format{"ARROW1"sv,
           "is Feather (Arrow): write it as CSV, as in python3 -c \"import pandas; "
           "pandas.read_feather('IN').to_csv('OUT.csv', index=False)\""},
    Format{"\xFF\xFE"sv, "is UTF-16: convert it, as in iconv -f UTF-16 -t UTF-8 IN > OUT.csv"},
    Format{"\xFE\xFF"sv, "is UTF-16: convert it, as in iconv -f UTF-16 -t UTF-8 IN > OUT.csv"},
    Format{"\x89HDF\r\n"sv, "is HDF5: name its file unpacked, it can't come through a pipe"},
    Format{"MATLAB "sv, "is a MATLAB file: name its file unpacked, it can't come through a pipe"},
    Format{"\x93NUMPY"sv, "is a numpy array: write it as CSV, as in numpy.savetxt('OUT.csv', array, delimiter=',')"},
    Format{"#ROSBAG"sv, "is a bag of ROS 1: convert it to ROS 2, as in rosbags-convert --src IN.bag --dst OUT"},
    Format{"\x89MCAP0"sv, "is an MCAP recording: name its file, it can't come through a pipe"},
    Format{"SQLite format 3"sv, "is an SQLite database (a ROS 2 bag): name its file, it can't come through a pipe"},
    Format{"BZh"sv, "is compressed by bzip2: unpack it with bunzip2"},
    Format{"\xFD"
           "7zXZ"sv,
           "is compressed by xz: unpack it with unxz"},
    Format{"\x28\xB5\x2F\xFD"sv, "is compressed by zstd twice: unpack it with unzstd"},
    Format{"%PDF"sv, "is a PDF: a log is a table of numbers (CSV)"},
    Format{"\x7F"
           "ELF"sv,
           "is a program: a log is a table of numbers (CSV)"},
    Format{"<"sv, "is XML (a URDF?): a log is a table of numbers (CSV)"},
    Format{"{"sv, "is JSON: write its signals as columns of a CSV"},
    Format{"version https://git-lfs"sv, "is a pointer of Git LFS, not the log: fetch it with git lfs pull"},
};

/// Bytes at the start in which a text has no zero.
constexpr std::size_t looked_at = 4096;

}  // namespace

std::string foreign_format(std::string_view bytes) {
  for (const Format& format : formats) {
    if (bytes.starts_with(format.magic)) return format.words;
  }
  const std::string_view start = bytes.substr(0, looked_at);
  const auto zeros = std::count(start.begin(), start.end(), '\0');
  if (zeros == 0) return "";
  // ASCII in two bytes a character: every other one is zero.
  if (static_cast<std::size_t>(zeros) * 10 > start.size() * 4)
    return "is UTF-16 without a mark: convert it, as in iconv -f UTF-16LE -t UTF-8 IN > OUT.csv";
  return "holds binary data: a log is a table of numbers in text (CSV)";
}

}  // namespace fxdyn
