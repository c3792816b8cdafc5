#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Edits (insert, delete, replace a character) that turn one word into the other.
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

/// The known word that `word` was probably meant to be. Words: a non-empty range of strings.
template <class Words>
std::string nearest(std::string_view word, const Words& words) {
  return std::string(*std::min_element(words.begin(), words.end(), [word](std::string_view a, std::string_view b) {
    return edit_distance(word, a) < edit_distance(word, b);
  }));
}

}  // namespace fxdyn
