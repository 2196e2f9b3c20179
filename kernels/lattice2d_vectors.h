// Vectors in the plane, velocities and the matrices between these; one number of each lane in each.

#pragma once

#include "lanes.h"

namespace ethogram {
namespace lattice2d {

using ethogram::fma;
using ethogram::fnma;

template <class Lanes>
struct Vector2 {
  Lanes x, y;
};

// Linear and angular.
template <class Lanes>
struct Vector3 {
  Lanes x, y, w;
};

// Symmetric, of Vector3.
template <class Lanes>
struct Matrix {
  Lanes xx, xy, yy, xw, yw, ww;
};

template <class Lanes>
ETHOGRAM_INLINE Vector2<Lanes> operator+(Vector2<Lanes> a, Vector2<Lanes> b) {
  return {a.x + b.x, a.y + b.y};
}
template <class Lanes>
ETHOGRAM_INLINE Vector2<Lanes> operator-(Vector2<Lanes> a, Vector2<Lanes> b) {
  return {a.x - b.x, a.y - b.y};
}
template <class Lanes>
ETHOGRAM_INLINE Vector2<Lanes> operator-(Vector2<Lanes> a) {
  return {-a.x, -a.y};
}
template <class Lanes>
ETHOGRAM_INLINE Lanes dot(Vector2<Lanes> a, Vector2<Lanes> b) {
  return fma(a.x, b.x, a.y * b.y);
}
template <class Lanes>
ETHOGRAM_INLINE Lanes cross(Vector2<Lanes> a, Vector2<Lanes> b) {
  return fma(a.x, b.y, -(a.y * b.x));
}

// A vector turned by an angle, of which cosine and sine are given.
template <class Lanes>
ETHOGRAM_INLINE Vector2<Lanes> rotated(Vector2<Lanes> turn, Vector2<Lanes> v) {
  return {fma(turn.x, v.x, -(turn.y * v.y)), fma(turn.y, v.x, turn.x * v.y)};
}

// A scaled by s, added to b.
template <class Lanes>
ETHOGRAM_INLINE Vector2<Lanes> fma(Lanes s, Vector2<Lanes> a, Vector2<Lanes> b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y)};
}
template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> fma(Lanes s, Vector3<Lanes> a, Vector3<Lanes> b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.w, b.w)};
}

template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> times(const Matrix<Lanes>& m, Vector3<Lanes> v) {
  return {fma(m.xx, v.x, fma(m.xy, v.y, m.xw * v.w)), fma(m.xy, v.x, fma(m.yy, v.y, m.yw * v.w)),
          fma(m.xw, v.x, fma(m.yw, v.y, m.ww * v.w))};
}

// By cofactors.
template <class Lanes>
ETHOGRAM_INLINE Matrix<Lanes> inverse(const Matrix<Lanes>& m) {
  Matrix<Lanes> c = {fma(m.yy, m.ww, -(m.yw * m.yw)), fma(m.xw, m.yw, -(m.xy * m.ww)),
                     fma(m.xx, m.ww, -(m.xw * m.xw)), fma(m.xy, m.yw, -(m.yy * m.xw)),
                     fma(m.xy, m.xw, -(m.xx * m.yw)), fma(m.xx, m.yy, -(m.xy * m.xy))};
  Lanes one = broadcast((decltype(m.xx[0] + 0))1);
  Lanes per = one / fma(m.xx, c.xx, fma(m.xy, c.xy, m.xw * c.xw));
  return {c.xx * per, c.xy * per, c.yy * per, c.xw * per, c.yw * per, c.ww * per};
}

}  // namespace lattice2d
}  // namespace ethogram
