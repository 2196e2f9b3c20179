// Vectors of lanes: one number of each of the robots that move side by side.
//
// Every product that is summed is an explicit fma, and nothing crosses lanes, so that a lane has the
// same bits whatever its neighbours hold and however wide the vectors are.  A processor without fma
// rounds twice.

#pragma once

#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#define ETHOGRAM_INLINE inline __attribute__((always_inline))

namespace ethogram {

#if defined(__AVX512F__) && defined(__AVX512DQ__)
constexpr int VECTOR_BYTES = 64;
#elif defined(__AVX2__) && defined(__FMA__)
constexpr int VECTOR_BYTES = 32;
#else
constexpr int VECTOR_BYTES = 16;
#endif

typedef float Floats __attribute__((vector_size(VECTOR_BYTES)));
typedef double Doubles __attribute__((vector_size(VECTOR_BYTES)));

// The vector of a type of numbers, and what comparing such vectors gives: all bits set where true.
template <class Number>
struct VectorOf;
template <>
struct VectorOf<float> {
  typedef Floats type;
  typedef int32_t Flag;
};
template <>
struct VectorOf<double> {
  typedef Doubles type;
  typedef int64_t Flag;
};
template <class Number>
using Vector = typename VectorOf<Number>::type;
template <class Number>
using Mask = decltype(Vector<Number>{} < Vector<Number>{});
template <class Number>
constexpr int LANES = VECTOR_BYTES / sizeof(Number);

// fma(a, b, c) = a b + c, fnma(a, b, c) = c - a b.
#if defined(__AVX512F__) && defined(__AVX512DQ__)
ETHOGRAM_INLINE Floats fma(Floats a, Floats b, Floats c) { return _mm512_fmadd_ps(a, b, c); }
ETHOGRAM_INLINE Doubles fma(Doubles a, Doubles b, Doubles c) { return _mm512_fmadd_pd(a, b, c); }
ETHOGRAM_INLINE Floats fnma(Floats a, Floats b, Floats c) { return _mm512_fnmadd_ps(a, b, c); }
ETHOGRAM_INLINE Doubles fnma(Doubles a, Doubles b, Doubles c) { return _mm512_fnmadd_pd(a, b, c); }
ETHOGRAM_INLINE Floats root(Floats a) { return _mm512_sqrt_ps(a); }
ETHOGRAM_INLINE Doubles root(Doubles a) { return _mm512_sqrt_pd(a); }
ETHOGRAM_INLINE Floats broadcast(float a) { return _mm512_set1_ps(a); }
ETHOGRAM_INLINE Doubles broadcast(double a) { return _mm512_set1_pd(a); }
ETHOGRAM_INLINE bool any(Mask<float> m) { return _mm512_movepi32_mask((__m512i)m) != 0; }
ETHOGRAM_INLINE bool any(Mask<double> m) { return _mm512_movepi64_mask((__m512i)m) != 0; }
#elif defined(__AVX2__) && defined(__FMA__)
ETHOGRAM_INLINE Floats fma(Floats a, Floats b, Floats c) { return _mm256_fmadd_ps(a, b, c); }
ETHOGRAM_INLINE Doubles fma(Doubles a, Doubles b, Doubles c) { return _mm256_fmadd_pd(a, b, c); }
ETHOGRAM_INLINE Floats fnma(Floats a, Floats b, Floats c) { return _mm256_fnmadd_ps(a, b, c); }
ETHOGRAM_INLINE Doubles fnma(Doubles a, Doubles b, Doubles c) { return _mm256_fnmadd_pd(a, b, c); }
ETHOGRAM_INLINE Floats root(Floats a) { return _mm256_sqrt_ps(a); }
ETHOGRAM_INLINE Doubles root(Doubles a) { return _mm256_sqrt_pd(a); }
ETHOGRAM_INLINE Floats broadcast(float a) { return _mm256_set1_ps(a); }
ETHOGRAM_INLINE Doubles broadcast(double a) { return _mm256_set1_pd(a); }
ETHOGRAM_INLINE bool any(Mask<float> m) { return _mm256_movemask_epi8((__m256i)m) != 0; }
ETHOGRAM_INLINE bool any(Mask<double> m) { return _mm256_movemask_epi8((__m256i)m) != 0; }
#else
ETHOGRAM_INLINE Floats fma(Floats a, Floats b, Floats c) { return a * b + c; }
ETHOGRAM_INLINE Doubles fma(Doubles a, Doubles b, Doubles c) { return a * b + c; }
ETHOGRAM_INLINE Floats fnma(Floats a, Floats b, Floats c) { return c - a * b; }
ETHOGRAM_INLINE Doubles fnma(Doubles a, Doubles b, Doubles c) { return c - a * b; }
ETHOGRAM_INLINE Floats broadcast(float a) { return Floats{a, a, a, a}; }
ETHOGRAM_INLINE Doubles broadcast(double a) { return Doubles{a, a}; }
#if defined(__SSE2__)
ETHOGRAM_INLINE Floats root(Floats a) { return _mm_sqrt_ps(a); }
ETHOGRAM_INLINE Doubles root(Doubles a) { return _mm_sqrt_pd(a); }
ETHOGRAM_INLINE bool any(Mask<float> m) { return _mm_movemask_epi8((__m128i)m) != 0; }
ETHOGRAM_INLINE bool any(Mask<double> m) { return _mm_movemask_epi8((__m128i)m) != 0; }
#else
ETHOGRAM_INLINE Floats root(Floats a) {
  return Floats{sqrtf(a[0]), sqrtf(a[1]), sqrtf(a[2]), sqrtf(a[3])};
}
ETHOGRAM_INLINE Doubles root(Doubles a) { return Doubles{sqrt(a[0]), sqrt(a[1])}; }
ETHOGRAM_INLINE bool any(Mask<float> m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }
ETHOGRAM_INLINE bool any(Mask<double> m) { return (m[0] | m[1]) != 0; }
#endif
#endif

template <class Lanes>
ETHOGRAM_INLINE Lanes absolute(Lanes a) {
  typedef decltype(a < a) Bits;
  return (Lanes)((Bits)a & ~(Bits)(-Lanes{}));  // all bits but the sign
}

// a with its sign turned where b is negative.
template <class Lanes>
ETHOGRAM_INLINE Lanes with_sign_of(Lanes b, Lanes a) {
  typedef decltype(a < a) Bits;
  return (Lanes)((Bits)a ^ ((Bits)b & (Bits)(-Lanes{})));
}

// The larger, or smaller, of two; the second where the first is not a number.
template <class Lanes>
ETHOGRAM_INLINE Lanes larger(Lanes a, Lanes b) {
  return a > b ? a : b;
}
template <class Lanes>
ETHOGRAM_INLINE Lanes smaller(Lanes a, Lanes b) {
  return a < b ? a : b;
}

// Which lanes of an array's last axis a block of robots is: `count` of them from `first` on.  Lanes
// of a vector that are beyond are copies of the last one, and are never stored.
struct Block {
  int64_t first;
  int64_t count;
};

template <class Number>
ETHOGRAM_INLINE Vector<Number> load(const Number* row, Block block) {
  Vector<Number> lanes;
  row += block.first;
  if (__builtin_expect(block.count == LANES<Number>, 1)) {
    memcpy(&lanes, row, sizeof lanes);
    return lanes;
  }
  if (block.count == 1) return broadcast(*row);
  Number copies[LANES<Number>];
  for (int lane = 0; lane < LANES<Number>; lane++)
    copies[lane] = row[lane < block.count ? lane : block.count - 1];
  memcpy(&lanes, copies, sizeof lanes);
  return lanes;
}

template <class Number>
ETHOGRAM_INLINE void store(Number* row, Block block, Vector<Number> lanes) {
  row += block.first;
  if (__builtin_expect(block.count == LANES<Number>, 1))
    memcpy(row, &lanes, sizeof lanes);
  else if (block.count == 1)
    *row = lanes[0];
  else
    memcpy(row, &lanes, block.count * sizeof(Number));
}

// The same of truth values, a byte each.
template <class Number>
ETHOGRAM_INLINE Mask<Number> load_flags(const uint8_t* row, Block block) {
  typedef typename VectorOf<Number>::Flag Flag;
  uint8_t bytes[LANES<Number>];
  Flag flags[LANES<Number>];
  row += block.first;
  if (block.count == 1) return *row ? ~Mask<Number>{} : Mask<Number>{};
  if (__builtin_expect(block.count == LANES<Number>, 1))
    memcpy(bytes, row, sizeof bytes);
  else
    for (int lane = 0; lane < LANES<Number>; lane++)
      bytes[lane] = row[lane < block.count ? lane : block.count - 1];
  for (int lane = 0; lane < LANES<Number>; lane++) flags[lane] = -(Flag)(bytes[lane] != 0);
  Mask<Number> mask;
  memcpy(&mask, flags, sizeof mask);
  return mask;
}

// Which of some counts are 0.
template <class Number>
inline Mask<Number> load_zeros(const int32_t* row, Block block) {
  typename VectorOf<Number>::Flag flags[LANES<Number>];
  if (block.count == 1) return row[block.first] == 0 ? ~Mask<Number>{} : Mask<Number>{};
  for (int lane = 0; lane < LANES<Number>; lane++)
    flags[lane] = row[block.first + (lane < block.count ? lane : block.count - 1)] == 0 ? -1 : 0;
  Mask<Number> mask;
  memcpy(&mask, flags, sizeof mask);
  return mask;
}

template <class Number>
ETHOGRAM_INLINE void store_flags(uint8_t* row, Block block, Mask<Number> mask) {
  typename VectorOf<Number>::Flag flags[LANES<Number>];
  uint8_t bytes[LANES<Number>];
  row += block.first;
  if (block.count == 1) {
    *row = (uint8_t)(mask[0] & 1);
    return;
  }
  memcpy(flags, &mask, sizeof mask);
  for (int lane = 0; lane < LANES<Number>; lane++) bytes[lane] = (uint8_t)(flags[lane] & 1);
  if (__builtin_expect(block.count == LANES<Number>, 1))
    memcpy(row, bytes, sizeof bytes);
  else
    memcpy(row, bytes, block.count);
}

// A square of numbers turned about its diagonal, by exchanges over halves of it, quarters, and so on.
template <int... at>
struct Places {};
template <int count, int... at>
struct UpTo : UpTo<count - 1, count - 1, at...> {};
template <int... at>
struct UpTo<0, at...> {
  typedef Places<at...> type;
};

template <int distance, bool upper, class Lanes, int... at>
ETHOGRAM_INLINE Lanes exchanged(Lanes a, Lanes b, Places<at...>) {
#if defined(__clang__)
  constexpr int COUNT = sizeof...(at);
  return upper ? __builtin_shufflevector(a, b, (at & distance ? COUNT + at : at + distance)...)
               : __builtin_shufflevector(a, b, (at & distance ? COUNT + at - distance : at)...);
#else
  constexpr int COUNT = sizeof...(at);
  typedef decltype(a < a) Index;
  return upper ? __builtin_shuffle(a, b, Index{(at & distance ? COUNT + at : at + distance)...})
               : __builtin_shuffle(a, b, Index{(at & distance ? COUNT + at - distance : at)...});
#endif
}

template <class Number, int distance = LANES<Number> / 2>
ETHOGRAM_INLINE void transpose(Vector<Number>* rows) {
  constexpr int COUNT = LANES<Number>;
  typename UpTo<COUNT>::type places;
  for (int row = 0; row < COUNT; row++) {
    if (row & distance) continue;
    Vector<Number> a = rows[row], b = rows[row + distance];
    rows[row] = exchanged<distance, false>(a, b, places);
    rows[row + distance] = exchanged<distance, true>(a, b, places);
  }
  if constexpr (distance > 1) transpose<Number, distance / 2>(rows);
}

// A block's robots from [lane, row] to [row, LANES], its last one repeated, and back.
template <class Number>
inline void lanes_last(const Number* from, int64_t rows, Block block, Number* to) {
  constexpr int COUNT = LANES<Number>;
  from += block.first * rows;
  auto lane_at = [&](int64_t lane) {
    return from + (lane < block.count ? lane : block.count - 1) * rows;
  };
  for (int64_t row = 0; rows >= COUNT; row = row + 2 * COUNT <= rows ? row + COUNT : rows - COUNT) {
    Vector<Number> square[COUNT];
    for (int lane = 0; lane < COUNT; lane++)
      memcpy(&square[lane], lane_at(lane) + row, sizeof square[lane]);
    transpose<Number>(square);
    memcpy(to + row * COUNT, square, sizeof square);
    if (row + COUNT == rows) return;  // the last square reaches back over some rows again
  }
  for (int lane = 0; lane < COUNT; lane++)
    for (int64_t row = 0; row < rows; row++) to[row * COUNT + lane] = lane_at(lane)[row];
}

template <class Number>
inline void lanes_first(const Number* from, int64_t rows, Block block, Number* to) {
  constexpr int COUNT = LANES<Number>;
  to += block.first * rows;
  for (int64_t row = 0; rows >= COUNT; row = row + 2 * COUNT <= rows ? row + COUNT : rows - COUNT) {
    Vector<Number> square[COUNT];
    memcpy(square, from + row * COUNT, sizeof square);
    transpose<Number>(square);
    for (int lane = 0; lane < block.count; lane++)
      memcpy(to + lane * rows + row, &square[lane], sizeof square[lane]);
    if (row + COUNT == rows) return;
  }
  for (int lane = 0; lane < block.count; lane++)
    for (int64_t row = 0; row < rows; row++) to[lane * rows + row] = from[row * COUNT + lane];
}

}  // namespace ethogram
