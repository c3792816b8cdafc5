#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace fxdyn {

/// Where an array is: the names of the groups or structs around it, then its own.
using ArrayPath = std::vector<std::string>;

/// An array of a file. Its numbers come in the order of `shape` with the last dimension fastest.
struct ArrayInfo {
  ArrayPath path;
  std::vector<std::uint64_t> shape;  ///< without dimensions of 1; a number: empty
  bool by_columns = false;           ///< its program writes the shape the other way round: MATLAB
  std::string type;                  ///< for people: "double", "int16", "cell"
  std::string trouble;               ///< why it can't be read as numbers; empty: it can
  std::string text;                  ///< of short texts
  /// What the file or its data set calls the numbers of a sample, where it does: LeRobot.
  std::vector<std::string> channels{};
  std::uint64_t size() const;
  /// As its program says it: "3000 x 6 double".
  std::string described() const;
};

struct ArrayList {
  std::vector<ArrayInfo> arrays;
  char mark = '/';     ///< between the names of a path: '.' in MATLAB
  double rate_hz = 0;  ///< of demonstrations without stamps (robomimic: control_freq in env_args); 0: not known
  std::string name_of(const ArrayPath& path) const;
};

/// Whether that is a file of MATLAB (4 by its name, 5, 7.3), of HDF5 or of Parquet (or the folder of a data set of
/// LeRobot, of which one file has to be named). Look at the first bytes; read no
/// pipe.
bool is_matlab(const std::filesystem::path& file);
bool is_hdf5(const std::filesystem::path& file);
bool is_parquet(const std::filesystem::path& file);

/// What a file has, in its own order.
/// @throws InputError naming the file: it can't be read, is cut or damaged
ArrayList list_arrays(const std::filesystem::path& file);

/// So many numbers go on at once, or somewhat more: 512 kB.
inline constexpr std::uint64_t numbers_at_once = std::uint64_t{1} << 16;

/// Gets numbers of the array `which`, from its number `at` on.
using ArrayNumbers = std::function<void(std::size_t which, std::uint64_t at, std::span<const double> numbers)>;

/// Reads the arrays of these paths piece by piece, one after another.
/// @throws InputError as list_arrays()
void read_arrays(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers);

/// The formats. HDF5: groups and datasets, also those of MATLAB 7.3. MATLAB 4 and 5: by libmatio. Parquet: columns; of
/// a file with several episodes (episode_index of LeRobot), those of each as "episode_3", its rows alone.
ArrayList list_hdf5(const std::filesystem::path& file);
void read_hdf5(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers);
ArrayList list_mat5(const std::filesystem::path& file);
void read_mat5(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers);
ArrayList list_parquet(const std::filesystem::path& file);
void read_parquet(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers);

/// What to say of arrays that hold something else than real numbers.
std::string cell_trouble(const std::string& name);
std::string sparse_trouble(const std::string& name);
std::string complex_trouble(const std::string& name);
std::string object_trouble(const std::string& name);

}  // namespace fxdyn
