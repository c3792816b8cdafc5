#include "host_tools/signals/encoder_edges.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A position that is known, at a time in samples.
struct Knot {
  double t = 0, q = 0;
};

/// Edges are known to lie between neighbouring counts only; a larger step crosses several at unknown times.
constexpr double one_count = 1.5;
/// Values of one count differ by rounding only.
constexpr double same_count = 0.25;

/// Knots of the samples [first, last], which have one count.
void add_run(const Eigen::Ref<const VectorXd>& q, Index first, Index last, double step, std::vector<Knot>& to) {
  const auto at = [](Index k) { return static_cast<double>(k); };
  if (first == last) {
    to.push_back({at(first), q[first]});
    return;
  }
  const auto edge = [&](Index before) { return 0.5 * (q[before] + q[before + 1]); };
  const auto is_edge = [&](Index before) { return std::fabs(q[before + 1] - q[before]) < one_count * step; };
  const bool begins = first > 0 && is_edge(first - 1), ends = last + 1 < q.size() && is_edge(last);
  // At rest until the first edge, and from the last one on.
  const double rest = begins ? edge(first - 1) : ends ? edge(last) : q[first];
  if (begins)
    to.push_back({at(first) - 0.5, rest});
  else
    to.push_back({at(first), first == 0 ? rest : q[first]});
  if (ends)
    to.push_back({at(last) + 0.5, edge(last)});
  else
    to.push_back({at(last), last + 1 == q.size() ? rest : q[last]});
}

}  // namespace

VectorXd between_edges(const Eigen::Ref<const VectorXd>& q, double step) {
  const Index n = q.size();
  if (n == 0 || !(step > 0)) return q;
  std::vector<Knot> knots;
  for (Index first = 0; first < n;) {
    Index last = first;
    while (last + 1 < n && std::fabs(q[last + 1] - q[first]) < same_count * step) ++last;
    add_run(q, first, last, step, knots);
    first = last + 1;
  }
  VectorXd out(n);
  std::size_t after = 0;
  for (Index k = 0; k < n; ++k) {
    const auto t = static_cast<double>(k);
    while (after + 1 < knots.size() && knots[after].t < t) ++after;
    const Knot& b = knots[after];
    const Knot& a = knots[after > 0 ? after - 1 : 0];
    const double share = b.t > a.t ? std::clamp((t - a.t) / (b.t - a.t), 0.0, 1.0) : 1.0;
    out[k] = a.q + share * (b.q - a.q);
  }
  return out;
}

}  // namespace fxdyn
