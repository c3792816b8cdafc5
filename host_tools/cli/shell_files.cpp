#include "host_tools/cli/shell_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "host_tools/cli/verb.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/nearest.hpp"
#include "model/version.hpp"

namespace fxdyn::cli {
namespace {

/// "--out" of an option; "" of one without a long name, as PROJECT.
std::string long_name(const CLI::Option& option) {
  return option.get_lnames().empty() ? "" : "--" + option.get_lnames().front();
}

std::vector<std::string> long_names(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::Option* option : verb.get_options()) {
    if (!long_name(*option).empty()) names.push_back(long_name(*option));
  }
  return names;
}

std::vector<const CLI::App*> verbs_of(const CLI::App& program) {
  return program.get_subcommands([](auto*) { return true; });
}

std::vector<std::string> verb_names(const CLI::App& program) {
  std::vector<std::string> names;
  for (const CLI::App* verb : verbs_of(program)) names.push_back(verb->get_name());
  return names;
}

bool takes_a_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

/// What --help says of a verb, before its example, in one line.
std::string summary(const std::string& text) {
  std::string out = text.substr(0, text.find("\nExample: "));
  std::replace(out.begin(), out.end(), '\n', ' ');
  return out;
}

/// As it can stand in zsh's 'name[words]' and 'name:words' inside single quotes.
std::string for_zsh(const std::string& words) {
  std::string out;
  for (const char c : summary(words)) {
    if (c == '\'') {
      out += "'\\''";
      continue;
    }
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

/// As it can stand in roff: no request, no escape, every line its own.
std::string for_roff(const std::string& words) {
  std::string out;
  bool starts = true;
  for (const char c : words) {
    if (starts && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
    starts = c == '\n';
    if (starts) out += ".br\n";
  }
  return out;
}

std::string option_entry(const CLI::Option& option) {
  const std::string name = long_name(option), value = option.get_type_name();
  const std::string shown = name.empty() ? option.get_name(true) : name;
  return fmt::format(".TP\n\\fB{}\\fR{}\n{}\n", for_roff(shown),
                     takes_a_value(option) && !name.empty() && !value.empty() ? " " + for_roff(value) : "",
                     for_roff(option.get_description().empty() ? "-" : option.get_description()));
}

}  // namespace

std::string bash_completion(const CLI::App& program) {
  std::string cases;
  for (const CLI::App* verb : verbs_of(program))
    cases += fmt::format("    {}) words=\"{}\" ;;\n", verb->get_name(), fmt::join(long_names(*verb), " "));
  return fmt::format(
      R"(# bash completion of fxdyn, made by: fxdyn completion bash
_fxdyn() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} words=
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{} --help --version" -- "$current"))
    return
  fi
  [[ $current == -* ]] || return 0  # a file
  case ${{COMP_WORDS[1]}} in
{}  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _fxdyn fxdyn
)",
      fmt::join(verb_names(program), " "), cases);
}

std::string zsh_completion(const CLI::App& program) {
  std::string verbs, cases;
  for (const CLI::App* verb : verbs_of(program)) {
    verbs += fmt::format("  '{}:{}'\n", verb->get_name(), for_zsh(verb->get_description()));
    cases += fmt::format("  {}) _arguments", verb->get_name());
    for (const CLI::Option* option : verb->get_options()) {
      const std::string name = long_name(*option);
      if (name.empty()) continue;
      cases += fmt::format(" '{}[{}]{}'", name, for_zsh(option->get_description()),
                           takes_a_value(*option) ? ":value:_files" : "");
    }
    cases += " '*:file:_files' ;;\n";
  }
  return fmt::format(
      "#compdef fxdyn\n# zsh completion of fxdyn, made by: fxdyn completion zsh\nlocal -a verbs=(\n{}  )\nif (( "
      "CURRENT == "
      "2 )); then\n  _describe verb verbs\n  return\nfi\nlocal verb=$words[2]\nshift words\n(( CURRENT-- ))\ncase "
      "$verb in\n{}esac\n",
      verbs, cases);
}

std::string man_page(const CLI::App& program, const CLI::App& of) {
  const bool whole = &program == &of;
  const std::string name = whole ? "fxdyn" : "fxdyn-" + of.get_name(),
                    command = whole ? "fxdyn" : "fxdyn " + of.get_name();
  std::string upper = name;
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? char(c - 32) : c; });
  std::string out = fmt::format(".TH {} 1 \"\" \"fxdyn {}\" \"fxdyn\"\n.SH NAME\n{} \\- {}\n", upper, version,
                                for_roff(name), for_roff(summary(of.get_description())));
  std::string places;
  for (const CLI::Option* option : of.get_options()) {
    if (long_name(*option).empty()) places += option->get_name(true) + " ";
  }
  out += fmt::format(".SH SYNOPSIS\n.B {}\n{}{}[OPTIONS]\n.SH DESCRIPTION\n{}\n.SH OPTIONS\n", for_roff(command),
                     whole ? "VERB " : "", for_roff(places), for_roff(of.get_description()));
  for (const CLI::Option* option : of.get_options()) out += option_entry(*option);
  if (whole) {
    out += ".SH VERBS\n";
    for (const CLI::App* verb : verbs_of(program))
      out +=
          fmt::format(".TP\n\\fB{}\\fR\n{}\n", for_roff(verb->get_name()), for_roff(summary(verb->get_description())));
  }
  return out + ".SH EXIT STATUS\n0: done. 1: the data can't support the answer. 2: usage or bad input.\n";
}

std::string command_that_works(const CLI::App& program, const std::vector<std::string>& words,
                               const std::string& unknown) {
  const auto used = program.get_subcommands();
  const std::vector<std::string> known = used.empty() ? verb_names(program) : long_names(*used.front());
  const std::string plain = unknown.substr(0, unknown.find('='));
  const bool replaceable = !unknown.empty() && (used.empty() || unknown.starts_with("--"));
  if (replaceable) {
    // Half of a word's letters may be wrong: what is farther is another word.
    const std::string near = nearest(plain, known);
    if (2 * edit_distance(plain, near) <= plain.size()) {
      std::string out = "fxdyn";
      bool done = false;
      for (const std::string& word : words) {
        const bool wrong = !done && word.substr(0, word.find('=')) == plain;
        out += " " + (wrong ? near + word.substr(plain.size()) : word);
        done = done || wrong;
      }
      return out;
    }
  }
  for (const Verb& verb : verbs()) {
    const bool here = used.empty() ? std::string_view(verb.name) == "run" : used.front()->get_name() == verb.name;
    if (here) return fmt::format("fxdyn {} {}", verb.name, verb.example);
  }
  return "";
}

namespace {

/// The program whose verb this is.
const CLI::App& program_of(CLI::App& verb) { return *verb.get_parent(); }

}  // namespace

Action add_completion(CLI::App& verb) {
  const auto shell = std::make_shared<std::string>();
  verb.add_option("shell", *shell, "bash or zsh")->required()->check(CLI::IsMember({"bash", "zsh"}));
  return [shell, &verb] {
    fmt::print("{}", *shell == "bash" ? bash_completion(program_of(verb)) : zsh_completion(program_of(verb)));
  };
}

Action add_man(CLI::App& verb) {
  const auto name = std::make_shared<std::string>();
  verb.add_option("verb", *name, "whose page; without: that of fxdyn");
  return [name, &verb] {
    const CLI::App& program = program_of(verb);
    const std::vector<std::string> names = verb_names(program);
    if (!name->empty() && std::find(names.begin(), names.end(), *name) == names.end())
      throw InputError(fmt::format("man: '{}' is no verb: as in `fxdyn man {}`", *name, nearest(*name, names)));
    for (const CLI::App* one : verbs_of(program)) {
      if (one->get_name() == *name) fmt::print("{}", man_page(program, *one));
    }
    if (name->empty()) fmt::print("{}", man_page(program, program));
  };
}

}  // namespace fxdyn::cli
