// expect: too many initializers
#include "tests/golden/tables.hpp"

using fxdyn::tables::Model;

constexpr auto words = Model::effect_words;
#ifdef FXDYN_OK
constexpr std::array<std::int32_t, words> table{};
#else
constexpr std::array<std::int32_t, words + 1> table{};
#endif
using Words = decltype(Model::Parameters::words);
template <std::size_t... i>
constexpr Words copy(std::index_sequence<i...>) {
  return Words{table[i]...};
}
constexpr Words copied = copy(std::make_index_sequence<table.size()>{});
