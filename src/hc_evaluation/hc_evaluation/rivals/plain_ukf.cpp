// A scaled unscented Kalman filter as one writes it in C++ with Eigen, for hc bench speed: fixed
// sizes, no allocation, nothing adaptive. Model, points and numbers as in plain_ukf.py beside it.
// Compiled by the benchmark where a compiler and Eigen are there; nothing else uses it.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace {

constexpr int N = 7;           // d, v, a, ln K, ln B, n, p
constexpr int POINTS = 2 * N + 1;
using State = Eigen::Matrix<double, N, 1>;
using Covariance = Eigen::Matrix<double, N, N>;
using Points = Eigen::Matrix<double, N, POINTS>;
using Reading = Eigen::Matrix<double, 2, 1>;
using Readings = Eigen::Matrix<double, 2, POINTS>;

struct Filter {
  State x;
  Covariance P, Q;
  Eigen::Matrix2d R;
  Eigen::Matrix<double, POINTS, 1> Wm, Wc;
  double dt;

  Points draw() const {
    const Covariance L = (double(N) * P).llt().matrixL();
    Points sigma;
    sigma.col(0) = x;
    for (int i = 0; i < N; ++i) {
      sigma.col(1 + i) = x + L.col(i);
      sigma.col(1 + N + i) = x - L.col(i);
    }
    return sigma;
  }

  void step(const Reading &z) {
    Points sigma = draw();
    for (int i = 0; i < POINTS; ++i) {
      sigma(0, i) += dt * sigma(1, i) + 0.5 * dt * dt * sigma(2, i);
      sigma(1, i) += dt * sigma(2, i);
    }
    x = sigma * Wm;
    Points dx = sigma.colwise() - x;
    P = dx * Wc.asDiagonal() * dx.transpose() + Q;
    sigma = draw();
    dx = sigma.colwise() - x;

    Readings h;
    for (int i = 0; i < POINTS; ++i) {
      const double d = std::max(sigma(0, i), 0.0), v = sigma(1, i);
      const double sign = v > 0.0 ? 1.0 : (v < 0.0 ? -1.0 : 0.0);
      const double damping = std::exp(sigma(4, i)) * sign * std::pow(std::abs(v), sigma(6, i));
      h(0, i) = sigma(0, i);
      h(1, i) = std::max(std::pow(d, sigma(5, i)) * (std::exp(sigma(3, i)) + damping), 0.0);
    }
    const Reading mean = h * Wm;
    const Readings dz = h.colwise() - mean;
    const Eigen::Matrix2d S = dz * Wc.asDiagonal() * dz.transpose() + R;
    const Eigen::Matrix<double, N, 2> C = dx * Wc.asDiagonal() * dz.transpose();
    const Eigen::Matrix<double, N, 2> K = C * S.inverse();
    x += K * (z - mean);
    P -= K * S * K.transpose();
  }
};

}  // namespace

// start: x (7), P (49, row-major), Q (49), R (4), dt. samples: d, F of each, (count, 2). states:
// takes x after each, (count, 7).
extern "C" void plain_ukf_run(const double *start, const double *samples, long count,
                              double *states) {
  using RowMajor = Eigen::Matrix<double, N, N, Eigen::RowMajor>;
  Filter filter;
  filter.x = Eigen::Map<const State>(start);
  filter.P = Eigen::Map<const RowMajor>(start + N);
  filter.Q = Eigen::Map<const RowMajor>(start + N + N * N);
  filter.R = Eigen::Map<const Eigen::Matrix2d>(start + N + 2 * N * N);
  filter.dt = start[N + 2 * N * N + 4];
  filter.Wm.setConstant(0.5 / N);  // alpha = 1, beta = 2, kappa = 0
  filter.Wc = filter.Wm;
  filter.Wm(0) = 0.0;
  filter.Wc(0) = 2.0;
  for (long i = 0; i < count; ++i) {
    filter.step(Eigen::Map<const Reading>(samples + 2 * i));
    Eigen::Map<State>(states + N * i) = filter.x;
  }
}
