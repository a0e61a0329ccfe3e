// A number of the law, and what is done with it by bits: of one run, or by lane of LAW_LANES runs side by side. A file
// includes it for one width.

#ifndef VWT_LANE_H_
#define VWT_LANE_H_

#include <math.h>

#define INLINE static inline __attribute__((always_inline))  // also into every clone (lanes.h)

#ifdef LAW_LANES
enum { WIDTH = LAW_LANES };
// A number by lane, with the vector extension of GCC and Clang, and what a comparison of two gives: all bits or none.
typedef double Lane __attribute__((vector_size(8 * LAW_LANES)));
typedef long long Mask __attribute__((vector_size(8 * LAW_LANES)));
#define AT(numbers, k) (numbers)[k]
#define ACTS(coefficient) 1  // in some lane, at the price of none

INLINE Mask sign(void) { return (Mask)(-(Lane){0}); }  // its bit alone
INLINE Lane size_of(Lane x) { return (Lane)((Mask)x & ~sign()); }
INLINE Lane with_sign(Lane size, Lane x) { return (Lane)((Mask)size | ((Mask)x & sign())); }
INLINE Lane choose(Mask where, Lane one, Lane other) {
  return (Lane)((where & (Mask)one) | (~where & (Mask)other));
}
INLINE long long all(Mask where) {
  long long out = -1;
  for (int k = 0; k < WIDTH; k++) {
    out &= where[k];
  }
  return out;
}
#else
enum { WIDTH = 1 };
typedef double Lane;
typedef int Mask;
#define AT(numbers, k) (&(numbers))[k]
#define ACTS(coefficient) ((coefficient) != 0)

INLINE Lane size_of(Lane x) { return fabs(x); }
INLINE Lane with_sign(Lane size, Lane x) { return copysign(size, x); }
INLINE Lane choose(Mask where, Lane one, Lane other) { return where ? one : other; }
INLINE int all(Mask where) { return where; }
#endif

#endif  // VWT_LANE_H_
