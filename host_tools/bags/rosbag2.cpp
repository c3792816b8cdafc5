#include <fmt/format.h>
#include <sqlite3.h>

#include <map>
#include <memory>

#include "host_tools/bags/bag.hpp"
#include "host_tools/bytes/unpack.hpp"
#include "host_tools/support/error.hpp"

// rosbag2_storage_sqlite3: topics(id, name, type, serialization_format, ..), messages(id, topic_id, timestamp [ns],
// data), and since its schema version 4 (Iron) message_definitions(id, topic_type, encoding,
// encoded_message_definition, ..).

namespace fxdyn {
namespace {

class Database {
 public:
  explicit Database(const std::filesystem::path& file) : name_(file.string()) {
    sqlite3* opened = nullptr;
    const int code = ::sqlite3_open_v2(name_.c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, nullptr);
    database_.reset(opened);
    if (code != SQLITE_OK) fail(code);
  }

  /// Calls `row` with each row of the answer.
  template <class Row>
  void ask(const std::string& query, Row row) const {
    sqlite3_stmt* made = nullptr;
    const int code = ::sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &made, nullptr);
    const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(made, ::sqlite3_finalize);
    if (code != SQLITE_OK) fail(code);
    int step = ::sqlite3_step(made);
    for (; step == SQLITE_ROW; step = ::sqlite3_step(made)) row(made);
    if (step != SQLITE_DONE) fail(step);
  }

  bool has_table(const std::string& name) const {
    bool found = false;
    ask(fmt::format("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = '{}'", name),
        [&](sqlite3_stmt*) { found = true; });
    return found;
  }

  const std::string& name() const { return name_; }

 private:
  [[noreturn]] void fail(int code) const {
    const bool damaged = (code & 0xFF) == SQLITE_CORRUPT || (code & 0xFF) == SQLITE_NOTADB;
    throw InputError(fmt::format("{}: {}: {}", name_, ::sqlite3_errstr(code),
                                 damaged ? "cut or damaged; copy it again, or save what is left with `sqlite3 BAG "
                                           ".recover | sqlite3 NEW.db3`"
                                         : "is it a bag of ROS 2, and closed?"));
  }

  std::string name_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_{nullptr, ::sqlite3_close};
};

std::string_view blob(sqlite3_stmt* row, int column) {
  const void* const bytes = ::sqlite3_column_blob(row, column);  // before its size, which may convert it
  const auto size = static_cast<std::size_t>(::sqlite3_column_bytes(row, column));
  return bytes == nullptr ? std::string_view() : std::string_view(static_cast<const char*>(bytes), size);
}

}  // namespace

BagEnd read_rosbag2(const std::filesystem::path& file, BagVisitor& visitor) {
  const Database database(file);
  if (!database.has_table("topics") || !database.has_table("messages"))
    throw InputError(database.name() + ": is an SQLite database without the tables of a ROS 2 bag: write it as CSV");
  std::map<std::string, std::string> definitions;  // of a type
  if (database.has_table("message_definitions")) {
    database.ask("SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'",
                 [&](sqlite3_stmt* row) { definitions[std::string(blob(row, 0))] = blob(row, 1); });
  }
  std::map<std::int64_t, std::size_t> wanted;  // topic's id -> the visitor's number
  std::string ids;
  database.ask("SELECT id, name, type, serialization_format FROM topics ORDER BY id", [&](sqlite3_stmt* row) {
    BagTopic topic{std::string(blob(row, 1)), std::string(blob(row, 2)), std::string(blob(row, 3)), {}};
    if (const auto found = definitions.find(topic.type); found != definitions.end()) topic.definition = found->second;
    const auto number = visitor.wants(topic);
    if (!number) return;
    const std::int64_t id = ::sqlite3_column_int64(row, 0);
    wanted[id] = *number;
    ids += fmt::format("{}{}", ids.empty() ? "" : ",", id);
  });
  if (wanted.empty()) return {};
  database.ask(fmt::format("SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({})", ids),
               [&](sqlite3_stmt* row) {
                 const std::size_t number = wanted.at(::sqlite3_column_int64(row, 0));
                 const std::int64_t time = ::sqlite3_column_int64(row, 1);
                 const std::string_view bytes = blob(row, 2);
                 // compression_mode MESSAGE packs each one.
                 if (is_zstd(bytes))
                   visitor.message(number, time, unpack_zstd(bytes, database.name()));
                 else
                   visitor.message(number, time, bytes);
               });
  return {};
}

}  // namespace fxdyn
