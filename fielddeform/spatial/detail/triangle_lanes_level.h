// The lanes of triangle_lanes.cpp, by way of core/detail/each_level.h.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

// Every sum below stands in the order of simplex_inline.h.
struct Lanes3 {
  Pack x, y, z;
};

LANES_INLINE void dotWith(const Lanes3& a, const double* b, Pack& out) {
  out = (a.x * b[0] + a.y * b[1]) + a.z * b[2];
}

// a - s b
LANES_INLINE void subtract(Lanes3& a, const Pack& s, const double* b) {
  a.x = a.x - s * b[0];
  a.y = a.y - s * b[1];
  a.z = a.z - s * b[2];
}

LANES_INLINE void from(const Lanes3& q, const double* corner, Lanes3& out) {
  out.x = q.x - corner[0];
  out.y = q.y - corner[1];
  out.z = q.z - corner[2];
}

// As onEdge(). @param pa, pb  query minus the ends
struct EdgeLanes {
  Pack square, t;
  Lanes3 offset;

  LANES_INLINE void find(const Lanes3& pa, const Lanes3& pb, const double* ab, double length2) {
    Pack along;
    dotWith(pa, ab, along);
    t = along / length2;
    const Pack s = 1 - t;
    const Mask early = t < 0.5, before = along > 0, after = along < length2;
    const Pack zero = {}, one = zero + 1.0;
    offset.x = early ? Pack(pa.x - t * ab[0]) : Pack(pb.x + s * ab[0]);
    offset.y = early ? Pack(pa.y - t * ab[1]) : Pack(pb.y + s * ab[1]);
    offset.z = early ? Pack(pa.z - t * ab[2]) : Pack(pb.z + s * ab[2]);
    offset.x = after ? offset.x : pb.x;
    offset.y = after ? offset.y : pb.y;
    offset.z = after ? offset.z : pb.z;
    t = after ? t : one;
    offset.x = before ? offset.x : pa.x;
    offset.y = before ? offset.y : pa.y;
    offset.z = before ? offset.z : pa.z;
    t = before ? t : zero;
    square = (offset.x * offset.x + offset.y * offset.y) + offset.z * offset.z;
  }
};

// As onTriangle().
struct TriangleLanes {
  Pack square, u, v, w;
  Lanes3 offset;

  LANES_INLINE void find(const TriangleTest& t, const Lanes3& q) {
    const Pack zero = {};
    square = zero + std::numeric_limits<double>::infinity();
    u = zero + 1.0;
    v = w = zero;
    from(q, t.a, offset);
    const Lanes3 pa = offset;
    Mask acrossA = zero == zero, acrossB = acrossA, acrossC = acrossA;
    if (t.plane) {
      onPlane(t, pa);
      const Mask within = (u >= 0) & (v >= 0) & (w >= 0);
      if (!t.thin) {
        acrossA = u < kOnEdge;
        acrossB = v < kOnEdge;
        acrossC = w < kOnEdge;
      }
      const Pack here = (offset.x * offset.x + offset.y * offset.y) + offset.z * offset.z;
      square = within ? here : square;
    }
    Lanes3 pb, pc;
    from(q, t.b, pb);
    from(q, t.c, pc);
    EdgeLanes e;
    if (anyOf(acrossC)) {
      e.find(pa, pb, t.ab, t.ab2);
      take(acrossC & (e.square < square), e, Pack(1 - e.t), e.t, zero);
    }
    if (anyOf(acrossB)) {
      e.find(pa, pc, t.ac, t.ac2);
      take(acrossB & (e.square < square), e, Pack(1 - e.t), zero, e.t);
    }
    if (anyOf(acrossA)) {
      e.find(pb, pc, t.bc, t.bc2);
      take(acrossA & (e.square < square), e, zero, Pack(1 - e.t), e.t);
    }
  }

 private:
  LANES_INLINE void onPlane(const TriangleTest& t, const Lanes3& pa) {
    const Lanes3 pc{pa.y * t.ac[2] - pa.z * t.ac[1], pa.z * t.ac[0] - pa.x * t.ac[2], pa.x * t.ac[1] - pa.y * t.ac[0]};
    const Lanes3 bp{t.ab[1] * pa.z - t.ab[2] * pa.y, t.ab[2] * pa.x - t.ab[0] * pa.z, t.ab[0] * pa.y - t.ab[1] * pa.x};
    dotWith(pc, t.n, v);
    dotWith(bp, t.n, w);
    v *= t.inverse;
    w *= t.inverse;
    subtract(offset, v, t.ab);
    subtract(offset, w, t.ac);
    if (t.refined) t.swap ? refine(t, w, v) : refine(t, v, w);
    u = (1 - v) - w;
  }

  LANES_INLINE void refine(const TriangleTest& t, Pack& onE, Pack& onF) {
    for (int i = 0; i < 3; ++i) {
      Pack de, df;
      dotWith(offset, t.along, de);
      de /= t.along2;
      subtract(offset, de, t.along);
      dotWith(offset, t.across, df);
      df /= t.across2;
      subtract(offset, df, t.across);
      onE += de - df * t.share;
      onF += df;
    }
  }

  LANES_INLINE void take(const Mask& better, const EdgeLanes& e, const Pack& a, const Pack& b, const Pack& c) {
    square = better ? e.square : square;
    offset.x = better ? e.offset.x : offset.x;
    offset.y = better ? e.offset.y : offset.y;
    offset.z = better ? e.offset.z : offset.z;
    u = better ? a : u;
    v = better ? b : v;
    w = better ? c : w;
  }
};

inline constexpr std::size_t kWidth = sizeof(Pack) / 8, kParts = kGroup / kWidth;

LANES_INLINE void leastOf(const LinearBound& bound, const Lanes3& d, Pack& least) {
  dotWith(d, bound.offset, least);
  least += bound.least;
}

LANES_INLINE void loadQueries(const LaneQueries& queries, std::size_t at, Lanes3& q) {
  load(queries.x + at, q.x);
  load(queries.y + at, q.y);
  load(queries.z + at, q.z);
}

LANES_TARGET std::size_t within(const WithinTask& task) {
  Lanes3 d[kParts];
  Pack square[kParts];
  for (std::size_t k = 0; k < kParts; ++k) {
    Lanes3 q;
    loadQueries(task.queries, task.at + k * kWidth, q);
    from(q, task.queries.centre.data(), d[k]);
    load(task.hits.square + k * kWidth, square[k]);
  }
  std::size_t found = 0;
  for (std::size_t i = 0; i < task.bounds.size(); ++i) {
    Pack least;
    leastOf(task.bounds[i], d[0], least);
    Mask some = least <= square[0];
    for (std::size_t k = 1; k < kParts; ++k) {
      leastOf(task.bounds[i], d[k], least);
      some |= least <= square[k];
    }
    task.which[found] = static_cast<std::uint16_t>(i);
    found += anyOf(some) ? 1 : 0;
  }
  return found;
}

LANES_TARGET std::size_t inBoxes(const BoxTask& task) {
  Lanes3 q[kParts];
  Pack square[kParts];
  for (std::size_t k = 0; k < kParts; ++k) {
    loadQueries(task.queries, task.at + k * kWidth, q[k]);
    load(task.hits.square + k * kWidth, square[k]);
  }
  const Pack zero = {};
  std::size_t found = 0;
  for (const std::uint16_t i : task.which) {
    const LeafBox& leaf = task.leaves[i];
    Mask some = zero == zero;
    if (leaf.box) {
      some = zero != zero;
      for (std::size_t k = 0; k < kParts; ++k) {
        Lanes3 d;
        from(q[k], leaf.box->centre.data(), d);
        Pack sum = zero - leaf.slack;
        for (int a = 0; a < 3; ++a) {
          Pack beyond;
          dotWith(d, leaf.box->axis[a].data(), beyond);
          beyond = (beyond < 0 ? -beyond : beyond) - leaf.box->half[a];
          beyond = beyond > 0 ? beyond : zero;
          sum += beyond * beyond;
        }
        some |= sum <= square[k];
      }
    }
    task.which[found] = i;
    found += anyOf(some) ? 1 : 0;
  }
  return found;
}

LANES_TARGET void tryAll(const TryTask& task) {
  GroupHits& hits = task.hits;
  for (std::size_t p = 0; p < kGroup; p += kWidth) {
    Lanes3 q, d, offset;
    loadQueries(task.queries, task.at + p, q);
    from(q, task.queries.centre.data(), d);
    Pack square, element, test, u, v, w;
    load(hits.square + p, square);
    load(hits.element + p, element);
    load(hits.test + p, test);
    load(hits.x + p, offset.x);
    load(hits.y + p, offset.y);
    load(hits.z + p, offset.z);
    load(hits.u + p, u);
    load(hits.v + p, v);
    load(hits.w + p, w);
    const Pack zero = {};
    for (const std::uint16_t i : task.which) {
      const TriangleTest& t = task.tests[i];
      Pack least;
      leastOf(t.bound, d, least);
      if (!anyOf(least <= square)) continue;
      TriangleLanes hit;
      hit.find(t, q);
      const Mask better = (hit.square < square) | ((hit.square == square) & (t.element < element));
      square = better ? hit.square : square;
      element = better ? Pack(zero + t.element) : element;
      test = better ? Pack(zero + static_cast<double>(i)) : test;
      offset.x = better ? hit.offset.x : offset.x;
      offset.y = better ? hit.offset.y : offset.y;
      offset.z = better ? hit.offset.z : offset.z;
      u = better ? hit.u : u;
      v = better ? hit.v : v;
      w = better ? hit.w : w;
    }
    store(square, hits.square + p);
    store(element, hits.element + p);
    store(test, hits.test + p);
    store(offset.x, hits.x + p);
    store(offset.y, hits.y + p);
    store(offset.z, hits.z + p);
    store(u, hits.u + p);
    store(v, hits.v + p);
    store(w, hits.w + p);
  }
}
