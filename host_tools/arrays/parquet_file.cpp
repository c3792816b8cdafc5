// Parquet as named arrays: a column is one, with a row each sample. A file of several episodes, as LeRobot writes them,
// has the columns of each as arrays of their own.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/arrays/lerobot.hpp"
#include "host_tools/arrays/parquet_chunk.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// LeRobot's column that says which episode a row is of.
constexpr std::string_view episode_column = "episode_index";

struct Episode {
  std::string name;  ///< "episode_3"; empty: the only one
  std::uint64_t begin = 0, end = 0;
};

/// Numbers a row, as its lists have them; nothing: they differ.
std::optional<std::uint64_t> numbers_each(const ParquetFooter& footer, std::size_t column) {
  std::uint64_t values = 0;
  for (const ParquetRows& group : footer.groups) values += group.chunks[column].values;
  if (footer.rows == 0 || values % footer.rows != 0) return {};
  const std::uint64_t each = values / footer.rows;
  if (footer.columns[column].repeated == 0 && each != 1) return {};
  return each;
}

/// @throws InputError: it is a data set
const std::filesystem::path& no_folder(const std::filesystem::path& file) {
  if (!is_lerobot(file)) return file;
  const std::filesystem::path first = first_file_of_lerobot(file);
  throw InputError(fmt::format("{}: is a data set of LeRobot: name one of its files, as in {}", file.string(),
                               (first.empty() ? file / "data/chunk-000/file-000.parquet" : first).string()));
}

/// An open file, its footer and its episodes.
class ParquetFile {
 public:
  explicit ParquetFile(const std::filesystem::path& file)
      : where_(file.string()), bytes_(no_folder(file)), footer_(read_parquet_footer(bytes_, where_)) {
    for (std::size_t k = 0; k < footer_.columns.size(); ++k) {
      ParquetColumn& column = footer_.columns[k];
      each_.push_back(numbers_each(footer_, k).value_or(0));
      if (footer_.rows > 0 && each_.back() == 0 && column.trouble.empty())
        column.trouble = column.repeated == 0 ? "is damaged: copy the file again"
                                              : "has lists of different lengths, or empty ones: drop those rows";
    }
    find_episodes();
  }

  const ParquetFooter& footer() const { return footer_; }
  const std::vector<Episode>& episodes() const { return episodes_; }
  std::uint64_t each(std::size_t column) const { return each_[column]; }
  static std::string name_of(const ParquetColumn& column) { return fmt::format("{}", fmt::join(column.path, ".")); }

  /// The rows of an episode.
  void read(std::size_t column, const Episode& episode, const std::function<void(std::span<const double>)>& take) {
    std::uint64_t first = 0;
    for (const ParquetRows& group : footer_.groups) {
      const std::uint64_t begin = std::max(episode.begin, first), end = std::min(episode.end, first + group.rows);
      if (begin < end) {
        const ParquetPart part{footer_.columns[column], group.chunks[column], group.rows, each_[column],
                               fmt::format("{}: {}", where_, name_of(footer_.columns[column]))};
        read_parquet_part(bytes_, buffers_, part, begin - first, end - first, take);
      }
      first += group.rows;
    }
  }

 private:
  void find_episodes() {
    const Episode all{"", 0, footer_.rows};
    episodes_ = {all};
    const auto found = std::find_if(footer_.columns.begin(), footer_.columns.end(), [](const ParquetColumn& column) {
      return column.path.size() == 1 && column.path[0] == episode_column && column.trouble.empty();
    });
    const auto column = static_cast<std::size_t>(found - footer_.columns.begin());
    if (found == footer_.columns.end() || each_[column] != 1 || footer_.rows == 0) return;
    std::vector<Episode> several;
    double now = 0;
    std::uint64_t row = 0;
    read(column, all, [&](std::span<const double> numbers) {
      for (const double number : numbers) {
        if (several.empty() || !(number == now)) several.push_back({name_of_episode(number), row, row});
        now = number;
        several.back().end = ++row;
      }
    });
    if (several.size() < 2) return;
    std::set<std::string> names;
    for (const Episode& one : several)
      if (!names.insert(one.name).second)
        throw InputError(
            fmt::format("{}: the rows of {} are not together: sort them by {}", where_, one.name, episode_column));
    episodes_ = std::move(several);
  }

  std::string name_of_episode(double number) const {
    constexpr double most = 1e15;
    if (!(std::fabs(number) < most))
      throw InputError(fmt::format("{}: {} has rows without a number: drop them", where_, episode_column));
    return fmt::format("episode_{}", static_cast<std::int64_t>(number));
  }

  std::string where_;
  ByteFile bytes_;
  ParquetBuffers buffers_;
  ParquetFooter footer_;
  std::vector<std::uint64_t> each_;
  std::vector<Episode> episodes_;
};

ArrayPath path_in(const Episode& episode, const ParquetColumn& column) {
  ArrayPath out = column.path;
  if (!episode.name.empty()) out.insert(out.begin(), episode.name);
  return out;
}

}  // namespace

ArrayList list_parquet(const std::filesystem::path& file) {
  const ParquetFile parquet(file);
  const auto names = lerobot_names(file);
  ArrayList out;
  out.mark = '.';
  for (const Episode& episode : parquet.episodes()) {
    for (std::size_t k = 0; k < parquet.footer().columns.size(); ++k) {
      const ParquetColumn& column = parquet.footer().columns[k];
      ArrayInfo array;
      array.path = path_in(episode, column);
      array.type = column.name;
      array.trouble = column.trouble;
      if (episode.end - episode.begin != 1) array.shape.push_back(episode.end - episode.begin);
      if (parquet.each(k) > 1) array.shape.push_back(parquet.each(k));
      if (const auto own = names.find(ParquetFile::name_of(column));
          own != names.end() && own->second.size() == parquet.each(k))
        array.channels = own->second;
      out.arrays.push_back(std::move(array));
    }
  }
  return out;
}

void read_parquet(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers) {
  ParquetFile parquet(file);
  for (std::size_t which = 0; which < paths.size(); ++which) {
    for (const Episode& episode : parquet.episodes()) {
      if (!episode.name.empty() && paths[which].front() != episode.name) continue;
      for (std::size_t k = 0; k < parquet.footer().columns.size(); ++k) {
        const ParquetColumn& column = parquet.footer().columns[k];
        if (path_in(episode, column) != paths[which] || !column.trouble.empty()) continue;
        std::uint64_t at = 0;
        parquet.read(k, episode, [&](std::span<const double> some) {
          numbers(which, at, some);
          at += some.size();
        });
      }
    }
  }
}

}  // namespace fxdyn
