#include "host_tools/regression/products.hpp"

#include <algorithm>

#include "host_tools/support/vectors.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index tall = 4, wide = 8;  ///< columns left and right whose products are summed in registers
constexpr Index cached_rows = 256;   ///< all columns of which stay in the processor's cache

/// sums (tall x wide, row by row) += left^T right
template <class V>
[[gnu::always_inline]] inline void add_products(const double* left, const double* right, Index rows, double* sums) {
  constexpr int parts = wide / V::size;
  typename V::Double sum[tall][parts];
#pragma GCC unroll 4
  for (int i = 0; i < tall; ++i) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) sum[i][p] = V::at(sums + wide * i + V::size * p).value;
  }
  for (Index r = 0; r < rows; ++r, left += tall, right += wide) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) {
      const typename V::Double x = V::at(right + V::size * p).value;
#pragma GCC unroll 4
      for (int i = 0; i < tall; ++i) sum[i][p] = sum[i][p] + left[i] * x;
    }
  }
#pragma GCC unroll 4
  for (int i = 0; i < tall; ++i) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) V::at(sums + wide * i + V::size * p).value = sum[i][p];
  }
}

void add_two(const double* left, const double* right, Index rows, double* sums) {
  add_products<Vector<2>>(left, right, rows, sums);
}
FXDYN_FOUR_AT_ONCE void add_four(const double* left, const double* right, Index rows, double* sums) {
  add_products<Vector<4>>(left, right, rows, sums);
}
FXDYN_EIGHT_AT_ONCE void add_eight(const double* left, const double* right, Index rows, double* sums) {
  add_products<Vector<8>>(left, right, rows, sums);
}

/// Some rows of columns in panels of `width` columns side by side, the last one filled up with zeros.
template <Index width>
class Panels {
 public:
  explicit Panels(Index columns) : data_(MatrixXd::Zero(width * cached_rows, (columns + width - 1) / width)) {}
  Index count() const { return data_.cols(); }
  const double* operator[](Index panel) const { return data_.col(panel).data(); }
  template <class Column>
  void set(Index column, const Column& values) {
    double* at = data_.col(column / width).data() + column % width;
    for (Index r = 0; r < values.size(); ++r) at[r * width] = values[r];
  }

 private:
  MatrixXd data_;
};

}  // namespace

JointMoments weighted_products(const Eigen::Ref<const MatrixXd>& base, const Eigen::Ref<const MatrixXd>& own,
                               const Eigen::Ref<const VectorXd>& weights, const Eigen::Ref<const VectorXd>& torque) {
  // [base, own]^T W [own, torque]
  const Index nb = base.cols(), n = own.cols();
  Panels<tall> left(nb + n);
  Panels<wide> right(n + 1);
  MatrixXd sums = MatrixXd::Zero(tall * wide, left.count() * right.count());
  // The upper triangle of own^T W own is the lower one's mirror image.
  const auto is_upper = [&](Index i, Index j) {
    return i * tall >= nb && (i + 1) * tall - 1 - nb < j * wide && (j + 1) * wide <= n;
  };
  const auto add = widest(&add_eight, &add_four, &add_two);
  for (Index from = 0; n > 0 && from < own.rows(); from += cached_rows) {
    const Index rows = std::min(cached_rows, own.rows() - from);
    const auto w = weights.segment(from, rows);
    for (Index c = 0; c < nb; ++c) left.set(c, w.cwiseProduct(base.col(c).segment(from, rows)));
    for (Index c = 0; c < n; ++c) {
      left.set(nb + c, w.cwiseProduct(own.col(c).segment(from, rows)));
      right.set(c, own.col(c).segment(from, rows));
    }
    right.set(n, torque.segment(from, rows));
    for (Index j = 0; j < right.count(); ++j) {
      for (Index i = 0; i < left.count(); ++i) {
        if (!is_upper(i, j)) add(left[i], right[j], rows, sums.col(i + j * left.count()).data());
      }
    }
  }
  const auto sum = [&](Index i, Index j) {
    return sums((i % tall) * wide + j % wide, i / tall + j / wide * left.count());
  };
  JointMoments out{MatrixXd(nb, n), MatrixXd(n, n), VectorXd(n)};
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < nb; ++i) out.cross(i, j) = sum(i, j);
    for (Index i = j; i < n; ++i) out.gram(i, j) = out.gram(j, i) = sum(nb + i, j);
    out.projection[j] = sum(nb + j, n);
  }
  return out;
}

}  // namespace fxdyn
