#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace fxdyn::cli {

// Files for shells and readers, made from the same options as --help: a new verb or option is in them by itself.

/// A script that bash, or zsh, reads to complete verbs, options and file names.
std::string bash_completion(const CLI::App& program);
std::string zsh_completion(const CLI::App& program);
/// The manual page of the program or of one of its verbs, in roff's man macros.
std::string man_page(const CLI::App& program, const CLI::App& of);

/// The command line with what is wrong put right: the nearest verb or option in place of an unknown one, else the
/// verb's example; "" where there is nothing near.
std::string command_that_works(const CLI::App& program, const std::vector<std::string>& words,
                               const std::string& unknown);

}  // namespace fxdyn::cli
