#pragma once

#include <array>

namespace fxdyn::paper {

/// Table 1 of Han, Wu, Hui, "Co-Optimization of Vibration Suppression and Data Efficiency in Robotic Manipulator
/// Dynamic Modeling", Appl. Sci. 2025, 15, 7679, as printed (its fourth column is headed "Joint 3" a second time).
/// Order 5, period 10 s, 500 Hz; series of Sec. 3.4: q = q0 + sum_k a_k / w_k sin(w_k t) - b_k / w_k cos(w_k t).
struct Series {
  double q0;                   ///< [rad]
  std::array<double, 5> a, b;  ///< [rad/s]
};
inline constexpr double period_s = 10, step_s = 0.002;
inline constexpr std::array<Series, 6> table1{{
    {-0.1738, {-0.7341, 0.1784, 0.4174, 0.4292, -1.5795}, {-0.6612, 0.2216, 0.2898, 0.8286, -0.9484}},
    {-0.0922, {-0.0259, 0.0426, 1.5415, -0.7398, 0.6055}, {0.5541, 2.6674, -0.5156, 0.1477, -0.3202}},
    {0.0631, {-0.1009, 0.4528, 0.2490, 1.7237, 0.3583}, {-1.5451, -0.3699, -0.2294, 1.2663, -1.6608}},
    {-0.6137, {-0.8351, 0.2441, 0.3279, -0.1248, 0.7880}, {-0.8694, 1.0831, 1.4351, -0.0740, 1.1983}},
    {0.4425, {-0.7559, 0.6617, -0.5766, -0.4196, -0.8074}, {0.7561, 0.9726, 0.6927, 0.8642, 1.9128}},
    {-0.0799, {-0.6254, 0.7819, 0.6088, -0.5076, -0.3085}, {-0.5224, -0.7831, 2.8099, -0.5941, 0.1656}},
}};

}  // namespace fxdyn::paper
