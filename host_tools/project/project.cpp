#include "host_tools/project/project.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>

#include "host_tools/effects/effect_library.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/logs/time_unit.hpp"
#include "host_tools/project/log_entries.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/pipes.hpp"
#include "host_tools/support/toml.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

using toml_input::as_boolean;
using toml_input::as_count;
using toml_input::as_number;
using toml_input::as_positive;
using toml_input::as_string;
using toml_input::Names;
using toml_input::Place;
using toml_input::set;
using toml_input::Table;
using toml_input::Value;

Names known_effects() {
  Names names;
  for (const std::string_view name : effect_names()) names.emplace_back(name);
  return names;
}

const Names signal_names{"t", "q", "dq", "ddq", "tau", "qlink", "temp"};
const Names unit_names{"s", "ms", "us", "ns"};
const Names role_names{"baseline", "train", "validate", "test"};
const Names method_names{"ls", "wls", "irls", "rls"};
const Names input_names{"physical", "bristles", "extended", "state"}, feature_names{"random", "sparse"};
const Names activation_names{"tanh", "sigmoid", "relu"};
/// Words of a text.
Names words(const char* text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}
const Names board_names = words(FXDYN_BOARDS);

auto between(int lowest, int highest) {
  return [=](const Value& value) {
    const int number = value.count(lowest);
    if (number > highest) value.place().fail(fmt::format("expected {} .. {}", lowest, highest));
    return number;
  };
}

class ProjectReader {
 public:
  explicit ProjectReader(const fs::path& file) : file_(file.string()), root_(toml_input::parse(file)) {
    project_.file = fs::absolute(file);
  }

  /// Of one key alone, given on the command line.
  ProjectReader(std::string name, toml::table root, const Robot& robot)
      : file_(std::move(name)), root_(std::move(root)) {
    project_.robot = robot;
  }
  LogFormat read_columns() {
    Table root({file_, "", 1}, root_);
    LogFormat format = read_format(root, {});
    root.finish();
    return format;
  }

  Project read() {
    Table root({file_, "", 1}, root_);
    if (auto table = root.table("effects")) read_effects(*table);
    read_robot(Table(root.need("robot", "add a table [robot] with urdf = \"...\"")));
    if (auto table = root.table("signals")) read_signals(*table);
    if (auto table = root.table("check")) {
      set(project_.check.columns, table->find("columns"), as_boolean);
      table->finish();
    }
    if (auto table = root.table("limits")) read_limits(*table);
    if (auto table = root.table("identify")) read_identify(*table);
    if (auto table = root.table("diagnose")) read_diagnose(*table);
    if (auto table = root.table("train")) read_train(*table);
    if (auto table = root.table("excite")) read_excite(*table);
    if (auto table = root.table("target")) read_target(*table);
    if (auto table = root.table("compare")) {
      set(project_.compare.enabled, table->find("enabled"), as_boolean);
      set(project_.compare.paper, table->find("paper"), as_boolean);
      table->finish();
    }
    if (auto table = root.table("report")) read_report(*table);
    const auto logs = root.find("log");
    root.finish();
    if (logs) {
      for (const Value& value : logs->items()) read_log_entry(Table(value));
    }
    check_logs();
    return project_;
  }

 private:
  std::size_t joints() const { return project_.robot.size(); }

  static std::string expand(const Value& value) {
    try {
      return with_home(with_variable(value.string()));
    } catch (const InputError& error) {
      value.place().fail(error.what());
    }
  }

  /// `log`: "-" (standard input), a FIFO and the folder of a bag are files, too.
  fs::path path(const Value& value, bool log = false) const {
    const std::string text = expand(value);
    if (log && text == "-") return text;
    const fs::path path = (project_.file.parent_path() / text).lexically_normal();
    if (!fs::is_regular_file(path) && !(log && (is_pipe(path) || fs::is_directory(path)))) {
      value.place().fail(fmt::format("no file '{}'; paths are relative to the project file", path.string()));
    }
    return path;
  }

  void read_robot(Table table) {
    project_.urdf = path(table.need("urdf", "add urdf = \"robot.urdf\""));
    project_.robot = read_urdf(project_.urdf);
    if (const auto gravity = table.find("gravity")) {
      const std::vector<double> g = gravity->numbers(3, "x, y, z in the base frame");
      project_.robot.gravity = Eigen::Vector3d(g[0], g[1], g[2]);
      // Zero is legitimate (one horizontal axis); thousands are mm/s^2.
      if (project_.robot.gravity.norm() > 30) gravity->place().fail("expected m/s^2, as in [0.0, 0.0, -9.81]");
    }
    set(project_.rated_torque, table.find("rated_torque"),
        [this](const Value& v) { return v.positives(joints(), per_joint()); });
    table.finish();
  }

  std::string per_joint() const { return fmt::format("one a joint of {}", project_.urdf.filename().string()); }

  void read_limits(Table& table) {
    if (const auto value = table.find("position")) {
      for (const Value& item : value->items()) {
        const std::vector<double> range = item.numbers(2, "lower, upper");
        if (!(range[0] < range[1])) item.place().fail("lower limit is not below the upper one");
        project_.limits.position.push_back({range[0], range[1]});
      }
      value->expect(project_.limits.position.size(), joints(), per_joint());
    }
    const auto per = [this](const Value& v) { return v.positives(joints(), per_joint()); };
    set(project_.limits.velocity, table.find("velocity"), per);
    set(project_.limits.acceleration, table.find("acceleration"), per);
    set(project_.limits.torque, table.find("torque"), per);
    if (const auto box = table.find("box")) read_box(*box);
    table.finish();
  }

  void read_box(const Value& value) {
    const std::vector<Value> items = value.items();
    value.expect(items.size(), 2, "two corners");
    std::array<Eigen::Vector3d, 2> corners;
    for (std::size_t i = 0; i < 2; ++i) {
      const std::vector<double> corner = items[i].numbers(3, "x, y, z");
      corners[i] = {corner[0], corner[1], corner[2]};
    }
    if (!(corners[0].array() < corners[1].array()).all()) {
      value.place().fail("each coordinate of the first corner must be below that of the second");
    }
    project_.limits.box = corners;
  }

  /// A prefix, or a column for each joint: in their order, by their names, or by the columns' numbers.
  void read_columns(const std::string& signal, const Value& value, LogFormat& format) {
    format.columns.erase(signal);
    format.joint_columns.erase(signal);
    if (value.is_boolean()) {
      if (value.boolean() || signal == "t" || signal == "q" || signal == "tau")
        value.place().fail("name its columns; `dq = false` and the like leave out what is not needed");
      format.columns[signal] = "";
    } else if (value.is_string()) {
      format.columns[signal] = value.string();
    } else if (signal == "t") {
      format.columns[signal] = column_name(value);
    } else if (value.is_list()) {
      const std::vector<Value> items = value.items();
      value.expect(items.size(), joints(), per_joint());
      for (const Value& item : items) format.joint_columns[signal].push_back(column_name(item));
    } else {
      Table names(value);
      for (const Joint& joint : project_.robot.joints)
        format.joint_columns[signal].push_back(column_name(names.need(joint.name, "name a column for every joint")));
      names.finish();
    }
  }
  static std::string column_name(const Value& value) {
    if (value.is_string()) return value.string();
    const double number = value.number();
    if (number < 0 || number != std::floor(number)) value.place().fail("a column's number counts from 0");
    return fmt::format("#{}", number);
  }

  LogFormat read_format(Table& table, LogFormat format) {
    if (auto columns = table.table("columns")) {
      for (const std::string& signal : signal_names) {
        if (const auto value = columns->find(signal)) read_columns(signal, *value, format);
      }
      columns->finish();
    }
    if (const auto topic = table.find("topic")) format.columns[topic_key] = topic->string();
    if (const auto unit = table.find("time_unit"))
      format.time_unit_s = 1 / time_unit(unit->name(unit_names, "unit of time")).per_second;
    set(format.torque_gain, table.find("torque_gain"), [this](const Value& v) {
      const std::vector<double> gains = v.numbers(joints(), per_joint());
      if (std::count(gains.begin(), gains.end(), 0.0) > 0) v.place().fail("a gain of 0 leaves no torque");
      return gains;
    });
    set(format.position_gain, table.find("position_gain"), [this](const Value& v) {
      const std::vector<double> gains = v.numbers(joints(), per_joint());
      if (std::count(gains.begin(), gains.end(), 0.0) > 0) v.place().fail("a gain of 0 leaves no motion");
      return gains;
    });
    set(format.position_offset, table.find("position_offset"),
        [this](const Value& v) { return v.numbers(joints(), per_joint()); });
    return format;
  }

  void read_signals(Table& table) {
    set(project_.signals.position_cutoff_hz, table.find("position_cutoff_hz"), as_positive);
    set(project_.signals.torque_cutoff_hz, table.find("torque_cutoff_hz"), as_positive);
    if (const auto lead = table.find("torque_lead_s")) {
      if (std::fabs(lead->number()) > 0.1) lead->place().fail("expected seconds, at most 0.1 either way");
      project_.signals.torque_lead_s = lead->number();
    }
    if (const auto edge = table.find("edge_s")) {
      if (edge->number() < 0) edge->place().fail("expected 0 or more");
      project_.signals.edge_s = edge->number();
    }
    default_format_ = read_format(table, {});
    table.finish();
  }

  void read_effects(Table& table) {
    if (const auto library = table.find("library")) {
      const std::string name = library->string();
      if (name.empty() || name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos)
        library->place().fail("lower case letters, digits and _ make a name, that of fxdyn_add_effects()");
      const std::string missing =
          fmt::format("there is no program fxdyn-{0} beside fxdyn: `cmake --build --preset host --target {0}`", name);
      if (name != effect_library()) throw OtherEffectLibrary(library->place().message(missing), name);
    }
    table.finish();
  }

  void read_identify(Table& table) {
    set(project_.identify.method, table.find("method"), [](const Value& v) { return v.name(method_names, "method"); });
    set(project_.identify.physical, table.find("physical"), as_boolean);
    set(project_.identify.essential, table.find("essential"), as_boolean);
    if (const auto forgetting = table.find("forgetting")) {
      project_.identify.forgetting = forgetting->positive();
      if (project_.identify.forgetting > 1) forgetting->place().fail("expected more than 0, at most 1");
    }
    if (const auto error = table.find("prior_error")) {
      project_.identify.prior_error = error->positive();
      if (project_.identify.method == "ls")
        error->place().fail("needs the residuals' variance: method wls, irls or rls");
    }
    if (const auto effects = table.find("effects")) {
      Names names;
      for (const Value& item : effects->items()) {
        names.push_back(item.name(known_effects(), "effect"));
        if (std::count(names.begin(), names.end(), names.back()) > 1)
          item.place().fail(fmt::format("'{}' is there twice", names.back()));
      }
      project_.identify.effects = names;
    }
    table.finish();
  }

  void read_diagnose(Table& table) {
    if (const auto value = table.find("max_effects")) project_.diagnose.max_effects = value->count(0);
    table.finish();
  }

  void read_train(Table& table) {
    TrainSettings& train = project_.train;
    set(train.enabled, table.find("enabled"), as_boolean);
    set(train.seed, table.find("seed"), [](const Value& v) { return static_cast<std::uint64_t>(v.integer(0)); });
    set(train.inputs, table.find("inputs"), [](const Value& v) { return v.name(input_names, "inputs"); });
    set(train.windows, table.find("windows"), between(1, 100));
    set(train.nodes, table.find("nodes"), between(1, 300));
    set(train.enhancement, table.find("enhancement"), as_count);
    set(train.activation, table.find("activation"),
        [](const Value& v) { return v.name(activation_names, "activation"); });
    set(train.features, table.find("features"), [](const Value& v) { return v.name(feature_names, "features"); });
    set(train.wavenumber, table.find("wavenumber"), as_positive);
    set(train.ridge, table.find("ridge"), as_positive);
    if (auto pso = table.table("pso")) train.pso = read_pso(*pso);
    table.finish();
  }

  static PsoSettings read_pso(Table& table) {
    PsoSettings pso;
    set(pso.particles, table.find("particles"), between(2, 1000));
    set(pso.iterations, table.find("iterations"), between(1, 10000));
    set(pso.stall, table.find("stall"), between(1, 10000));
    if (const auto list = table.find("activations")) {
      for (const Value& item : list->items()) pso.activations.push_back(item.name(activation_names, "activation"));
      if (pso.activations.empty()) list->place().fail("expected one activation at least");
    }
    if (auto bounds = table.table("bounds")) {
      const auto read = [&](std::array<double, 2>& to, const char* key, double least, double most) {
        const auto value = bounds->find(key);
        if (!value) return;
        const std::vector<double> ends = value->numbers(2, "lower, upper");
        if (!(ends[0] >= least && ends[0] <= ends[1] && ends[1] <= most))
          value->place().fail(fmt::format("expected {:g} <= lower <= upper <= {:g}", least, most));
        const bool whole = key != std::string_view("ridge");
        if (whole && (ends[0] != std::floor(ends[0]) || ends[1] != std::floor(ends[1])))
          value->place().fail("expected whole numbers");
        to = {ends[0], ends[1]};
      };
      read(pso.windows, "windows", 1, 100);
      // Linear feature nodes fold into the enhancement nodes: one number counts.
      read(pso.nodes, "nodes", 1, 300);
      read(pso.nodes, "enhancement", 1, 300);
      read(pso.ridge, "ridge", 1e-8, 1e3);
      bounds->finish();
    }
    table.finish();
    return pso;
  }

  void read_excite(Table& table) {
    ExciteSettings& excite = project_.excite;
    set(excite.period_s, table.find("period_s"), as_positive);
    set(excite.order, table.find("order"), between(2, 20));
    set(excite.trajectories, table.find("trajectories"), between(1, 100));
    if (const auto noise = table.find("noise")) {
      excite.noise =
          noise->is_list() ? noise->numbers(joints(), per_joint()) : std::vector<double>(joints(), noise->number());
      for (const double value : excite.noise) {
        if (value < 0) noise->place().fail("expected 0 or more");
      }
    }
    set(excite.seed, table.find("seed"), [](const Value& v) { return static_cast<std::uint64_t>(v.integer(0)); });
    set(excite.starts, table.find("starts"), between(1, 1000));
    if (const auto margin = table.find("margin")) {
      excite.margin = margin->number();
      if (excite.margin < 0 || excite.margin > 0.5) margin->place().fail("expected 0 .. 0.5, a share of each limit");
    }
    set(excite.step_s, table.find("step_s"), as_positive);
    // every harmonic's period has at least ten samples
    if (excite.step_s * 10 * excite.order > excite.period_s) {
      table.place().fail(fmt::format("step_s of {} s is above period_s / (10 x order) = {:.3g} s", excite.step_s,
                                     excite.period_s / (10 * excite.order)));
    }
    const double samples = excite.period_s / excite.step_s;
    if (samples > 1e6) table.place().fail(fmt::format("{:.3g} samples a period: expected at most a million", samples));
    if (std::fabs(samples - std::round(samples)) > 1e-6 * samples) {
      table.place().fail(
          fmt::format("period_s of {} s is no multiple of step_s, {} s", excite.period_s, excite.step_s));
    }
    table.finish();
  }

  void read_report(Table& table) {
    if (const auto share = table.find("good_enough")) {
      project_.report.good_enough = share->positive();
      if (project_.report.good_enough > 1) share->place().fail("expected a share of rated torque, at most 1");
    }
    table.finish();
  }

  void read_target(Table& table) {
    set(project_.target.board, table.find("board"), [](const Value& v) { return v.name(board_names, "board"); });
    if (const auto tick = table.find("tick_s")) {
      project_.target.tick_s = tick->positive();
      if (project_.target.tick_s < 5e-5 || project_.target.tick_s > 0.1) tick->place().fail("expected 5e-5 .. 0.1 s");
    }
    if (const auto error = table.find("accept_error")) {
      project_.target.accept_error = error->positive();
      if (project_.target.accept_error > 1) error->place().fail("expected a share of rated torque, at most 1");
    }
    if (const auto sequence = table.find("sequence")) {
      constexpr std::int64_t highest = 0x7FFF'FFFF;  // leaves room for updates
      const std::int64_t number = sequence->integer(1);
      if (number > highest) sequence->place().fail(fmt::format("expected 1 .. {}", highest));
      project_.target.sequence = static_cast<std::uint32_t>(number);
    }
    if (const auto joints = table.find("joints"); joints && !joints->is_string()) {
      for (const Value& value : joints->items()) {
        const auto joint = static_cast<std::size_t>(value.integer(1));
        if (joint > this->joints()) value.place().fail(fmt::format("expected 1 .. {}", this->joints()));
        project_.target.joints.push_back(joint - 1);
      }
    } else if (joints && joints->string() != "all") {
      joints->place().fail("expected \"all\" or a list of joints, as in [1, 2]");
    }
    table.finish();
  }

  void read_log_entry(Table table) {
    LogEntry entry;
    entry.line = table.place().line;
    const auto file = table.find("file"), scenario = table.find("scenario"), log = table.find("log");
    if (file.has_value() == scenario.has_value())
      table.place().fail("needs either file or scenario (with log = \"name\")");
    if (file) {
      entry.file = path(*file, true);
      if (log) log->place().fail("belongs to a scenario; remove it");
    } else {
      entry.scenario = path(*scenario);
      if (!log) scenario->place().fail("add log = \"name\": which of the scenario's logs");
      entry.scenario_log = log->string();
    }
    const std::string role = table.need("role", "baseline, train, validate or test").name(role_names, "role");
    entry.role = static_cast<Role>(std::find(role_names.begin(), role_names.end(), role) - role_names.begin());
    set(entry.from_s, table.find("from_s"), as_number);
    set(entry.to_s, table.find("to_s"), as_number);
    if (entry.from_s && entry.to_s && !(*entry.from_s < *entry.to_s)) table.place().fail("from_s is not below to_s");
    entry.format = read_format(table, default_format_);
    entry.own_format = entry.format != default_format_;
    if (!entry.scenario) entry.format = with_joint_names(entry.file, entry.format, project_.robot);
    if (auto payload = table.table("payload")) {
      Load load;
      if (const auto mass = payload->find("mass")) {
        if (mass->number() < 0) mass->place().fail("expected 0 or more");
        load.mass = mass->number();
      }
      if (const auto com = payload->find("com")) {
        const std::vector<double> r = com->numbers(3, "x, y, z");
        load.com = Eigen::Vector3d(r[0], r[1], r[2]);
      }
      if (load.mass > 0) entry.load = load;
      payload->finish();
    }
    table.finish();
    project_.logs.push_back(entry);
  }

  void check_logs() const {
    const auto source = [](const LogEntry& e) {
      return e.scenario ? e.scenario->string() + "/" + e.scenario_log : fs::weakly_canonical(e.file).string();
    };
    for (std::size_t i = 0; i < project_.logs.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const LogEntry &a = project_.logs[j], &b = project_.logs[i];
        if (!share_time(a, b)) continue;
        if (source(a) == source(b)) throw overlap(project_, a, b, "same file");
        // What a scenario makes is known once it was played: check_copies().
        if (!a.scenario && !b.scenario && same_content(a.file, b.file)) throw overlap(project_, a, b, same_bytes);
      }
    }
  }

  std::string file_;
  toml::table root_;
  Project project_;
  LogFormat default_format_;
};

}  // namespace

bool Project::has_role(Role role) const {
  return std::any_of(logs.begin(), logs.end(), [role](const LogEntry& entry) { return entry.role == role; });
}

LogFormat columns_of(const std::string& text, const Robot& robot) {
  try {
    return ProjectReader("--columns", toml::parse("columns = " + text), robot).read_columns();
  } catch (const toml::parse_error& error) {
    throw InputError(
        fmt::format("--columns: not valid TOML: {}; write '{{ t = \"..\", q = [\"..\", ..], tau = [\"..\", ..] }}'",
                    error.description()));
  }
}

Project read_project(const fs::path& file) { return ProjectReader(file).read(); }

}  // namespace fxdyn
