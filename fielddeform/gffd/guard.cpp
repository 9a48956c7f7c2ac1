#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/guard_kernel.h>
#include <fielddeform/gffd/guard.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::gffd {
namespace {

constexpr double kFactor = 0.6;
// How much float errs beyond slivers: normals by some 1e-3 rad, squared edges by some 3e-4 of them.
constexpr double kCosineMargin = 0.01, kStretchMargin = 2e-3;

class Guard {
 public:
  Guard(const mesh::Mesh& mesh, std::span<const Vec3> safe, std::span<Vec3> position, std::span<Status> status,
        const GuardOptions& options)
      : mesh_(mesh), safe_(safe), position_(position), status_(status), options_(options) {}

  GuardReport run() {
    GuardReport report;
    unit_ = unitOf();
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

  // The first look: triangles by blocks in float; what is suspect is looked at closely.
  class Look {
   public:
    Look(const Guard& guard, std::vector<Index>& found) : guard_(guard), found_(found) {
      const double cosine = std::abs(guard.options_.minCosine) + kCosineMargin, stretch = guard.options_.maxStretch;
      bounds_ = {static_cast<float>(cosine * cosine), static_cast<float>(stretch * stretch * (1 - kStretchMargin))};
    }
    void take(Index face, Index a, Index b, Index c) {
      const Vec3 &qa = guard_.safe_[a], &xa = guard_.position_[a];
      put(edges_.q1, guard_.safe_[b] - qa);
      put(edges_.q2, guard_.safe_[c] - qa);
      put(edges_.x1, guard_.position_[b] - xa);
      put(edges_.x2, guard_.position_[c] - xa);
      triangle_[count_] = {face, a, b, c};
      if (++count_ == detail::kGuardBlock) finish();
    }
    void finish() {
      std::int32_t suspect[detail::kGuardBlock];
      detail::findSuspects(edges_, bounds_, suspect);
      for (std::size_t i = 0; i < count_; ++i) {
        if (suspect[i] == 0) continue;
        const auto [face, a, b, c] = triangle_[i];
        if (!found_.empty() && found_.back() == face) continue;
        if (guard_.finite(a) && guard_.finite(b) && guard_.finite(c) && guard_.isBad(a, b, c, nullptr)) found_.push_back(face);
      }
      count_ = 0;
    }

   private:
    void put(float (&edge)[3][detail::kGuardBlock], const Vec3& e) const {
      for (int k = 0; k < 3; ++k) edge[k][count_] = static_cast<float>(e[k] * guard_.unit_);
    }

    const Guard& guard_;
    std::vector<Index>& found_;
    detail::GuardBounds bounds_{};
    detail::GuardEdges edges_{};
    std::array<std::array<Index, 4>, detail::kGuardBlock> triangle_;
    std::size_t count_ = 0;
  };

  // One over the usual length of an edge; a wrong one makes more triangles suspect.
  double unitOf() const {
    constexpr std::size_t kSampled = 64;
    const std::size_t n = mesh_.faceCount(), step = std::max<std::size_t>(1, n / kSampled);
    double sum = 0, count = 0;
    for (std::size_t f = 0; f < n; f += step)
      mesh_.forEachTriangle(static_cast<Index>(f), [&](Index a, Index b, Index) {
        const double l = (safe_[b] - safe_[a]).norm();
        if (l > 0 && std::isfinite(l)) sum += l, ++count;
      });
    const double unit = count / sum;
    return std::isfinite(unit) && unit > 0 ? unit : 1;
  }

  std::vector<Index> badFaces(const std::vector<double>* lambda) const {
    constexpr std::size_t kGrain = 8192;
    const std::size_t n = lambda ? near_.size() : mesh_.faceCount();
    std::vector<std::vector<Index>> found((n + kGrain - 1) / kGrain);
    parallelFor(n, kGrain, [&](std::size_t begin, std::size_t end) {
      std::vector<Index>& part = found[begin / kGrain];
      if (!lambda) {
        Look look(*this, part);
        for (std::size_t f = begin; f < end; ++f)
          mesh_.forEachTriangle(static_cast<Index>(f), [&](Index a, Index b, Index c) { look.take(static_cast<Index>(f), a, b, c); });
        look.finish();
        return;
      }
      for (std::size_t i = begin; i < end; ++i) {
        const Index f = near_[i];
        bool bad = false;
        mesh_.forEachTriangle(f, [&](Index a, Index b, Index c) {
          bad = bad || (finite(a) && finite(b) && finite(c) && isBad(a, b, c, lambda));
        });
        if (bad) part.push_back(f);
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
  double unit_ = 1;
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
