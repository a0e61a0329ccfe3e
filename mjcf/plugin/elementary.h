// Elementary functions: by arithmetic alone for runs side by side, which compute them together, and by the library for
// one run. They differ by the last digits.

#ifndef VWT_ELEMENTARY_H_
#define VWT_ELEMENTARY_H_

#include <math.h>

#include "lane.h"

#ifndef LAW_LANES
INLINE Lane sine(Lane angle) { return sin(angle); }
INLINE Lane cosine(Lane angle) { return cos(angle); }
INLINE Lane exponential(Lane x) { return exp(x); }
INLINE Lane logarithm(Lane x) { return log(x); }
INLINE Lane power(Lane x, Lane n) { return pow(x, n); }
INLINE Lane hyperbolic_tangent(Lane x) { return tanh(x); }
#else
typedef unsigned long long Bits __attribute__((vector_size(8 * LAW_LANES)));

// 1.5 * 2^52: in a sum with it, the last bit of a number is a whole one.
static const double kWhole = 6755399441055744.0;
// ln 2 in two parts; the product of the first with an exponent is exact.
static const double kLn2[2] = {6.93147180369123816490e-01, 1.90821492927058770002e-10};

// The sine of an angle and some quarter turns; the error is below 3e-16 up to 1e6 rad, where a motion has diverged.
INLINE Lane sine_of(Lane angle, unsigned quarters) {
  const Lane shifted = angle * 0.63661977236758134308 + kWhole, turns = shifted - kWhole;
  // a quarter turn in three parts; the products with the first two are exact
  const Lane first = angle - turns * 1.57079632673412561417, second = first - turns * 6.07710050630396597660e-11;
  const Lane x = second - turns * 2.02226624879595063154e-21, z = x * x;  // |x| <= pi/4
  const Lane odd = 1.0 / 6 - z * (1.0 / 120 - z * (1.0 / 5040 - z * (1.0 / 362880 - z * (1.0 / 39916800 -
                   z * (1.0 / 6227020800 - z / 1307674368000)))));
  const Lane even = 1.0 / 24 - z * (1.0 / 720 - z * (1.0 / 40320 - z * (1.0 / 3628800 - z * (1.0 / 479001600 -
                    z * (1.0 / 87178291200 - z / 20922789888000)))));
  const Lane upright = x - x * z * odd, level = 1 - z * (0.5 - z * even);
  const Bits quarter = (Bits)shifted + quarters;
  const Lane size = choose((quarter & 1) != 0, level, upright);
  return choose((quarter & 2) != 0, -size, size);
}

INLINE Lane sine(Lane angle) { return sine_of(angle, 0); }
INLINE Lane cosine(Lane angle) { return sine_of(angle, 1); }

// e^x to 4e-16 of it, x within 700 of zero; beyond, that of the bound.
INLINE Lane exponential(Lane x) {
  const Lane none = {0}, above = choose(x < -700, none - 700, x), bounded = choose(above > 700, none + 700, above);
  const Lane shifted = bounded * 1.44269504088896340736 + kWhole, doublings = shifted - kWhole;
  const Lane r = (bounded - doublings * kLn2[0]) - doublings * kLn2[1];  // |r| <= ln(2)/2
  // the series to r^12/12! in parts, which do not wait for each other
  const Lane square = r * r, fourth = square * square;
  const Lane first = 1 + r + square * (1.0 / 2 + r * (1.0 / 6));
  const Lane second = 1.0 / 24 + r * (1.0 / 120) + square * (1.0 / 720 + r * (1.0 / 5040));
  const Lane third = 1.0 / 40320 + r * (1.0 / 362880) + square * (1.0 / 3628800 + r * (1.0 / 39916800));
  const Lane series = first + fourth * (second + fourth * (third + fourth * (1.0 / 479001600)));
  return (Lane)((Bits)series + ((Bits)shifted << 52));
}

// ln x of x > 0, to 4e-16 or that share of it.
INLINE Lane logarithm(Lane x) {
  const Lane none = {0};
  const Bits one = (Bits)(none + 1), least = (Bits)(none + 0.70710678118654752440);
  const Bits exponent = ((Bits)x + (one - least)) >> 52;  // of two, and 1023
  const Lane doublings = (Lane)((Bits)(none + kWhole) + exponent) - (kWhole + 1023);
  const Lane share = (Lane)((Bits)x - (exponent << 52) + one);  // between the roots of 1/2 and 2
  const Lane s = (share - 1) / (share + 1), z = s * s, square = z * z;  // ln share = 2 (s + s^3/3 + s^5/5 + ...)
  const Lane first = 1.0 / 3 + z * (1.0 / 5) + square * (1.0 / 7 + z * (1.0 / 9));
  const Lane second = 1.0 / 11 + z * (1.0 / 13) + square * (1.0 / 15 + z * (1.0 / 17) + square * (1.0 / 19));
  const Lane series = z * (first + square * square * second);
  return doublings * kLn2[0] + (doublings * kLn2[1] + 2 * (s + s * series));
}

// x^n of x >= 0; 0 where x is 0.
INLINE Lane power(Lane x, Lane n) { return choose(x > 0, exponential(n * logarithm(x)), (Lane){0}); }

INLINE Lane hyperbolic_tangent(Lane x) {
  const Lane left = exponential(-2 * size_of(x));
  return with_sign((1 - left) / (1 + left), x);
}
#endif

#endif  // VWT_ELEMENTARY_H_
