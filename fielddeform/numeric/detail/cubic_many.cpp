// Points in the order of a space-filling curve are halved into groups. Of the centres that a group has left, those that are far
// from it go into its polynomial, which its halves inherit; the rest they have left. The last groups add up what is left plainly.
// As [Greengard & Rokhlin 1987] without expansions of the centres: there are far fewer of these than points.
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/detail/cubic_many.h>
#include <fielddeform/numeric/detail/cubic_sum.h>
#include <fielddeform/numeric/detail/cubic_taylor.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace fielddeform::numeric::detail {
namespace {

// Costs, in those of one centre at one point (the same for all processors: the choice must not depend on them).
constexpr double kAddTerm = 0.5;  // of one centre's polynomial, a term
constexpr double kUseTerm = 0.2;  // of a polynomial at one point, a term
constexpr std::size_t kSplit = 800;  // points: smaller groups are not halved
constexpr std::size_t kFew = 48;     // centres: so few are added up plainly
constexpr std::size_t kWhole = 8;    // groups of more than this share of the points are halved without a look
constexpr double kNearest = 1e-6;    // centres nearer to a group's middle are never far: powers of 1 / distance stay in range

struct Keyed {
  std::uint32_t key, index;
};

constexpr int kKeyBits = 30, kPassBits = 10;
constexpr std::size_t kBins = std::size_t{1} << kPassBits, kBlock = 65536;

// Stable, by ten bits a pass; blocks count and write by themselves, so that threads make no difference.
void sortByKey(std::vector<Keyed>& items) {
  const std::size_t n = items.size(), blocks = (n + kBlock - 1) / kBlock;
  std::vector<Keyed> other(n);
  std::vector<std::array<std::uint32_t, kBins>> place(blocks);
  for (int shift = 0; shift < kKeyBits; shift += kPassBits) {
    const auto bin = [&](const Keyed& item) { return item.key >> shift & (kBins - 1); };
    parallelFor(n, kBlock, [&](std::size_t begin, std::size_t end) {
      auto& count = place[begin / kBlock];
      count.fill(0);
      for (std::size_t i = begin; i < end; ++i) ++count[bin(items[i])];
    });
    std::uint32_t next = 0;
    for (std::size_t b = 0; b < kBins; ++b)
      for (auto& p : place) {
        const std::uint32_t count = p[b];
        p[b] = next;
        next += count;
      }
    parallelFor(n, kBlock, [&](std::size_t begin, std::size_t end) {
      auto& at = place[begin / kBlock];
      for (std::size_t i = begin; i < end; ++i) other[at[bin(items[i])]++] = items[i];
    });
    items.swap(other);
  }
}

// Ten bits to every third place.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 16) & 0x030000FFu;
  x = (x | x << 8) & 0x0300F00Fu;
  x = (x | x << 4) & 0x030C30C3u;
  return (x | x << 2) & 0x09249249u;
}

struct Group {
  std::size_t begin = 0, end = 0;
  std::size_t middle = 0;           // where it is halved; begin: it is not
  int bit = kKeyBits - 1;           // of the key, that it is halved by
  std::size_t parent = 0;
  Vec3 origin = Vec3::Zero();
  std::vector<double> terms = {};   // about the origin; empty: none yet
  std::vector<Index> left = {};     // centres that are not in it
};

class Many {
 public:
  Many(const CubicCentres& centres, const CubicTolerance& tolerance, const std::function<void(std::size_t, const double*)>& take)
      : centres_(centres), tolerance_(tolerance), take_(take) {
    const double share = 1 / static_cast<double>(centres.centres.size());
    tolerance_.value *= share;
    tolerance_.gradient *= share;
    for (const Vec3& w : centres.weights) size_.push_back(centres.components == 1 ? std::abs(w.x()) : w.cwiseAbs().maxCoeff());
  }

  void run(Points points);

 private:
  void sort(Points points);
  void refine(const Group& parent, Group& g) const;
  double radiusOf(const Group& parent, Group& g) const;
  bool isFar(Index centre, const Vec3& origin, double radius) const;
  bool isWorthWhile(const Group& parent, const Group& g, std::size_t far) const;
  void addFar(const Group& parent, const std::vector<Index>& far, Group& g) const;
  void split(Group& g) const;
  void evaluate(const Group& g) const;

  CubicCentres centres_;
  CubicTolerance tolerance_;  // of one centre
  const std::function<void(std::size_t, const double*)>& take_;
  std::vector<double> size_;  // greatest weight of each centre
  std::vector<Keyed> items_;  // the points in order
  std::vector<Vec3> points_;
};

void Many::run(Points points) {
  sort(points);
  if (items_.empty()) return;
  Group all;
  for (Index c = 0; c < centres_.centres.size(); ++c) all.left.push_back(c);
  std::vector<Group> above, here(1);
  here[0].end = items_.size();
  refine(all, here[0]);
  for (;;) {
    above.clear();
    for (Group& g : here)
      if (g.middle > g.begin) above.push_back(std::move(g));
    if (above.empty()) return;
    here.clear();
    for (std::size_t a = 0; a < above.size(); ++a) {
      here.push_back({.begin = above[a].begin, .end = above[a].middle, .bit = above[a].bit - 1, .parent = a});
      here.push_back({.begin = above[a].middle, .end = above[a].end, .bit = above[a].bit - 1, .parent = a});
    }
    parallelFor(here.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t g = begin; g < end; ++g) refine(above[here[g].parent], here[g]);
    });
  }
}

void Many::sort(Points points) {
  Box box;
  for (const Vec3& p : points)
    if (takesCubicMany(p)) box.extend(p);
  if (box.isEmpty()) return;
  const double extent = box.sizes().maxCoeff(), cells = extent > 0 ? 1023.999 / extent : 0;
  const Vec3 low = box.min();
  constexpr std::uint32_t kLeftOut = ~std::uint32_t{0};
  items_.resize(points.size());
  parallelFor(points.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      items_[i] = {kLeftOut, static_cast<std::uint32_t>(i)};
      if (!takesCubicMany(points[i])) continue;
      const Vec3 c = (points[i] - low) * cells;
      items_[i].key = spread(static_cast<std::uint32_t>(c.x())) << 2 | spread(static_cast<std::uint32_t>(c.y())) << 1 |
                      spread(static_cast<std::uint32_t>(c.z()));
    }
  });
  std::erase_if(items_, [](const Keyed& k) { return k.key == kLeftOut; });
  sortByKey(items_);
  points_.resize(items_.size());
  parallelFor(items_.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) points_[i] = points[items_[i].index];
  });
}

// The middle of the group's box, and the greatest distance from it.
double Many::radiusOf(const Group& parent, Group& g) const {
  Box box;
  for (std::size_t i = g.begin; i < g.end; ++i) box.extend(points_[i]);
  g.origin = box.center();
  const double most = 0.5 * box.sizes().norm();
  // The ball around the box will do where it is too large by far.
  const bool hopeless = std::none_of(parent.left.begin(), parent.left.end(), [&](Index c) {
    return (centres_.centres[c] - g.origin).squaredNorm() > 2 * most * most;
  });
  if (hopeless) return most;
  double r2 = 0;
  for (std::size_t i = g.begin; i < g.end; ++i) r2 = std::max(r2, (points_[i] - g.origin).squaredNorm());
  return std::min(most, std::sqrt(r2));
}

bool Many::isFar(Index centre, const Vec3& origin, double radius) const {
  const double distance = (centres_.centres[centre] - origin).norm();
  if (!(distance > kNearest)) return false;
  const TaylorBound bound = taylorBound(radius, distance);
  return size_[centre] * bound.value <= tolerance_.value &&
         (centres_.components == 3 || size_[centre] * bound.gradient <= tolerance_.gradient);
}

bool Many::isWorthWhile(const Group& parent, const Group& g, std::size_t far) const {
  const double points = static_cast<double>(g.end - g.begin), terms = static_cast<double>(kTaylorTerms);
  const double added = static_cast<double>((far + kCubicLanes - 1) / kCubicLanes * kCubicLanes) * terms * kAddTerm;
  const double used = parent.terms.empty() ? points * terms * kUseTerm : 0;
  return points * static_cast<double>(far) > added + used;
}

void Many::refine(const Group& parent, Group& g) const {
  if ((g.end - g.begin) * kWhole > items_.size() && items_.size() >= kSplit) {
    g.left = parent.left;
    split(g);
    if (g.middle > g.begin) return;
    g.left.clear();
  }
  const double radius = radiusOf(parent, g) * (1 + 1e-12);
  std::vector<Index> far;
  for (const Index c : parent.left) (isFar(c, g.origin, radius) ? far : g.left).push_back(c);
  if (!isWorthWhile(parent, g, far.size())) {
    g.left = parent.left;
    far.clear();
  }
  addFar(parent, far, g);
  split(g);
  if (g.middle == g.begin) evaluate(g);
}

void Many::addFar(const Group& parent, const std::vector<Index>& far, Group& g) const {
  g.terms = parent.terms;
  if (!g.terms.empty())
    for (std::size_t c = 0; c < centres_.components; ++c) moveTaylor(g.origin - parent.origin, g.terms.data() + c * kTaylorTerms);
  if (far.empty()) return;
  g.terms.resize(centres_.components * kTaylorTerms, 0.0);
  const std::size_t count = (far.size() + kCubicLanes - 1) / kCubicLanes;
  std::vector<double> blocks(count * kCubicBlock, 0.0);
  for (std::size_t i = 0; i < count * kCubicLanes; ++i) {
    const Index c = far[std::min(i, far.size() - 1)];
    double* block = blocks.data() + i / kCubicLanes * kCubicBlock + i % kCubicLanes;
    for (int k = 0; k < 3; ++k) {
      block[k * kCubicLanes] = centres_.centres[c][k];
      if (i < far.size()) block[(3 + k) * kCubicLanes] = centres_.weights[c][k];
    }
  }
  addTaylor(blocks.data(), count, g.origin, centres_.components, g.terms.data());
}

void Many::split(Group& g) const {
  g.middle = g.begin;
  if (g.end - g.begin < kSplit || g.left.size() <= kFew) return;
  for (; g.bit >= 0; --g.bit) {
    const auto from = items_.begin() + static_cast<std::ptrdiff_t>(g.begin), to = items_.begin() + static_cast<std::ptrdiff_t>(g.end);
    const auto at = std::partition_point(from, to, [&](const Keyed& k) { return (k.key >> g.bit & 1) == 0; });
    if (at == from || at == to) continue;
    g.middle = static_cast<std::size_t>(at - items_.begin());
    return;
  }
}

void Many::evaluate(const Group& g) const {
  const std::size_t n = g.end - g.begin, padded = (n + kCubicTogether - 1) / kCubicTogether * kCubicTogether;
  const std::size_t results = centres_.components == 1 ? 4 : 3;
  std::vector<double> scratch((3 + results) * padded), near((3 + centres_.components) * g.left.size());
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i < padded; ++i) scratch[k * padded + i] = points_[g.begin + std::min(i, n - 1)][static_cast<int>(k)];
  double* to = near.data();
  for (const Index c : g.left) {
    for (int k = 0; k < 3; ++k) *to++ = centres_.centres[c][k];
    for (std::size_t k = 0; k < centres_.components; ++k) *to++ = centres_.weights[c][static_cast<int>(k)];
  }
  const CubicPoints points{scratch.data(), scratch.data() + padded, scratch.data() + 2 * padded, padded};
  double* out = scratch.data() + 3 * padded;
  const CubicNear sums{g.terms.empty() ? nullptr : g.terms.data(), g.origin, near.data(), g.left.size()};
  if (centres_.components == 1) cubicFirstTogether(sums, points, out);
  else cubicSumsTogether(sums, points, out);
  for (std::size_t i = 0; i < n; ++i) {
    double of[4];
    for (std::size_t s = 0; s < results; ++s) of[s] = out[s * padded + i];
    take_(items_[g.begin + i].index, of);
  }
}

}  // namespace

void cubicMany(const CubicCentres& centres, Points points, const CubicTolerance& tolerance,
               const std::function<void(std::size_t, const double*)>& take) {
  Many(centres, tolerance, take).run(points);
}

}  // namespace fielddeform::numeric::detail
