#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/fleet/fleet_file.hpp"
#include "host_tools/fleet/run.hpp"

namespace fxdyn::fleet {

struct SlurmOptions {
  std::vector<std::string> arguments;  ///< further ones of sbatch
  std::size_t chunk_size = 0;          ///< robots a task; 0: from measured times
  /// Work of a task [s]: a job of an array costs the scheduler 1 to 2 s (40 trivial ones took 74 s on one node).
  double chunk_s = 60;
  std::size_t most_tasks = 1000;  ///< of an array: Slurm's MaxArraySize is 1001 by default
  double look_s = 1;              ///< between two looks at the files [s]; hand
  double ask_s = 3;               ///< between two questions to squeue [s]; hand
  double tell_s = 30;             ///< where no robot ends, a line says so often what squeue says [s]; hand
  double settle_s = 2;   ///< after a job is gone, until a shared file system shows what its nodes wrote [s]; hand
  double margin_s = 30;  ///< beyond a robot's time limit, before an array that ends no robot counts as stuck [s]; hand
  /// Arrays in a row that end no robot, before it is given up; hand: a controller that crashes loses a job that it took
  /// less than 2 s before.
  int useless_rounds = 3;
};

/// @throws InputError: this machine has no sbatch
void check_slurm();
/// The words of a command line: blanks part them, but not within ' or ".
/// @throws InputError: a quotation mark is not closed
std::vector<std::string> words_of(const std::string& text);

/// Submits an array of `fxdyn fleet-worker --chunk k`, waits for the files, and submits again what is missing once the
/// array is gone. What counts as done stands in the files alone: neither sacct nor exit codes are asked.
/// @throws InputError: no sbatch, or it refuses
/// @throws DataError: Ctrl-C (the array goes on); an array that ended no robot
void run_on_slurm(const Fleet& fleet, const std::vector<Task>& tasks, const std::filesystem::path& directory,
                  const RunOptions& run, const SlurmOptions& options);

/// The part of the fleet that one worker has.
struct Chunk {
  std::size_t index = 0;
  std::size_t of = 0;  ///< every of-th robot, from index on; 0: those of DIR/chunks/INDEX.txt
};
/// @throws InputError: DIR has no such chunk here
void work_on_chunk(const Fleet& fleet, const std::filesystem::path& directory, const Chunk& chunk,
                   const RunOptions& run);

}  // namespace fxdyn::fleet
