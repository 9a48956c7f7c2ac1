#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/guard.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd {
namespace {

constexpr double kFactor = 0.6;
constexpr double kSlack = 1e-9;  // products of squares are rounded

class Guard {
 public:
  Guard(const mesh::Mesh& mesh, std::span<const Vec3> safe, std::span<Vec3> position, std::span<Status> status,
        const GuardOptions& options)
      : mesh_(mesh), safe_(safe), position_(position), status_(status), options_(options) {}

  GuardReport run() {
    GuardReport report;
    std::vector<Index> bad = badFaces(nullptr);
    if (bad.empty()) return report;
    prepare();
    for (; report.rounds < options_.maxRounds && !bad.empty(); ++report.rounds) {
      lower(bad);
      bad = badFaces(&lambda_);
    }
    report.remaining = bad.size();
    for (Index v = 0; v < lambda_.size(); ++v) {
      if (!(lambda_[v] < 1) || position_[v] == safe_[v]) continue;
      position_[v] = at(v, &lambda_);
      status_[v] = Status::Limited;
      report.limited.push_back(v);
    }
    return report;
  }

 private:
  bool held(Index v) const { return status_[v] == Status::Fixed || status_[v] == Status::Invalid; }

  Vec3 at(Index v, const std::vector<double>* lambda) const {
    if (!lambda || !((*lambda)[v] < 1)) return position_[v];
    return safe_[v] + (*lambda)[v] * (position_[v] - safe_[v]);
  }

  bool isBad(Index a, Index b, Index c, const std::vector<double>* lambda) const {
    const Vec3 q[3] = {safe_[a], safe_[b], safe_[c]}, x[3] = {at(a, lambda), at(b, lambda), at(c, lambda)};
    if (q[0] == x[0] && q[1] == x[1] && q[2] == x[2]) return false;
    const Vec3 n = (q[1] - q[0]).cross(q[2] - q[0]), m = (x[1] - x[0]).cross(x[2] - x[0]);
    const double nm = n.norm() * m.norm();
    // A triangle without predicted area has no side to keep.
    if (nm > 0 && n.dot(m) < options_.minCosine * nm) return true;
    for (int k = 0; k < 3; ++k) {
      const double before = (q[(k + 1) % 3] - q[k]).squaredNorm(), after = (x[(k + 1) % 3] - x[k]).squaredNorm();
      if (before > 0 && after > options_.maxStretch * options_.maxStretch * before) return true;
    }
    return false;
  }

  // True for most good triangles, without a root; the others, and what is no number, are looked at closely.
  bool isClear(Index a, Index b, Index c) const {
    const Vec3 &qa = safe_[a], &qb = safe_[b], &qc = safe_[c], &xa = position_[a], &xb = position_[b], &xc = position_[c];
    const Vec3 q1 = qb - qa, q2 = qc - qa, q3 = qc - qb, x1 = xb - xa, x2 = xc - xa, x3 = xc - xb;
    const Vec3 n = q1.cross(q2), m = x1.cross(x2);
    const double d = n.dot(m);
    const double most = options_.maxStretch * options_.maxStretch * (1 - kSlack);
    const bool turned = !(d > 0) || !(d * d > options_.minCosine * options_.minCosine * (1 + kSlack) * (n.squaredNorm() * m.squaredNorm()));
    const bool longer = !(x1.squaredNorm() < most * q1.squaredNorm()) || !(x2.squaredNorm() < most * q2.squaredNorm()) ||
                        !(x3.squaredNorm() < most * q3.squaredNorm());
    return !turned && !longer;
  }

  std::vector<Index> badFaces(const std::vector<double>* lambda) const {
    constexpr std::size_t kGrain = 8192;
    const std::size_t n = lambda ? near_.size() : mesh_.faceCount();
    std::vector<std::vector<Index>> found((n + kGrain - 1) / kGrain);
    parallelFor(n, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Index f = lambda ? near_[i] : static_cast<Index>(i);
        bool bad = false;
        mesh_.forEachTriangle(f, [&](Index a, Index b, Index c) {
          if (!lambda && isClear(a, b, c)) return;
          bad = bad || (finite(a) && finite(b) && finite(c) && isBad(a, b, c, lambda));
        });
        if (bad) found[begin / kGrain].push_back(f);
      }
    });
    std::vector<Index> all;
    for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
    return all;
  }

  bool finite(Index v) const { return safe_[v].allFinite() && position_[v].allFinite(); }

  // Faces at each vertex, in compressed rows.
  void prepare() {
    lambda_.assign(mesh_.vertexCount(), 1.0);
    start_.assign(mesh_.vertexCount() + 1, 0);
    for (const Index v : mesh_.corners()) ++start_[v + 1];
    for (std::size_t v = 0; v < mesh_.vertexCount(); ++v) start_[v + 1] += start_[v];
    faces_.resize(mesh_.cornerCount());
    std::vector<Index> next(start_.begin(), start_.end() - 1);
    for (Index f = 0; f < mesh_.faceCount(); ++f)
      for (const Index v : mesh_.face(f)) faces_[next[v]++] = f;
    near_.clear();
  }

  template <class F>
  void forEachRing(Index v, F&& call) const {
    for (Index i = start_[v]; i < start_[v + 1]; ++i)
      for (const Index u : mesh_.face(faces_[i]))
        if (u != v) call(u);
  }

  void lower(const std::vector<Index>& bad) {
    std::vector<Index> touched;
    for (const Index f : bad)
      for (const Index v : mesh_.face(f)) {
        touched.push_back(v);
        forEachRing(v, [&](Index u) { touched.push_back(u); });
      }
    unique(touched);
    for (const Index v : touched)
      if (!held(v)) lambda_[v] *= kFactor;
    active_.insert(active_.end(), touched.begin(), touched.end());
    unique(active_);
    // Smooth over the ring of all that was lowered so far, from the values before smoothing.
    std::vector<Index> around = active_;
    for (const Index v : active_) forEachRing(v, [&](Index u) { around.push_back(u); });
    unique(around);
    std::vector<double> smooth(around.size());
    for (std::size_t k = 0; k < around.size(); ++k) {
      double sum = lambda_[around[k]];
      int count = 1;
      forEachRing(around[k], [&](Index u) { sum += lambda_[u], ++count; });
      smooth[k] = std::min(lambda_[around[k]], sum / count);
    }
    for (std::size_t k = 0; k < around.size(); ++k)
      if (!held(around[k])) lambda_[around[k]] = smooth[k];
    active_ = around;
    near_.clear();
    for (const Index v : active_)
      for (Index i = start_[v]; i < start_[v + 1]; ++i) near_.push_back(faces_[i]);
    unique(near_);
  }

  static void unique(std::vector<Index>& v) {
    std::sort(v.begin(), v.end());
    v.erase(std::unique(v.begin(), v.end()), v.end());
  }

  const mesh::Mesh& mesh_;
  std::span<const Vec3> safe_;
  std::span<Vec3> position_;
  std::span<Status> status_;
  GuardOptions options_;
  std::vector<double> lambda_;
  std::vector<Index> start_, faces_, active_, near_;
};

}  // namespace

GuardReport guard(const mesh::Mesh& mesh, std::span<const Vec3> safe, std::span<Vec3> position,
                  std::span<Status> status, const GuardOptions& options) {
  const std::size_t n = mesh.vertexCount();
  if (safe.size() != n || position.size() != n || status.size() != n)
    throw std::invalid_argument("guard: safe, position and status need one element a vertex");
  return Guard(mesh, safe, position, status, options).run();
}

}  // namespace fielddeform::gffd
