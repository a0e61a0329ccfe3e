// The moment law, written once for every width: one run (moment.c), or LAW_LANES runs side by side (lanes.h). A file
// includes it for one width. Both widths do the same operations in the same order, so that their bits are the same.
// A term whose coefficient is zero vanishes: one run skips it, lanes add zero.

#ifndef VWT_LAW_H_
#define VWT_LAW_H_

#include <math.h>

#include "moment.h"

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
#else
enum { WIDTH = 1 };
typedef double Lane;
typedef int Mask;
#define AT(numbers, k) (&(numbers))[k]
#define ACTS(coefficient) ((coefficient) != 0)

INLINE Lane size_of(Lane x) { return fabs(x); }
INLINE Lane with_sign(Lane size, Lane x) { return copysign(size, x); }
INLINE Lane choose(Mask where, Lane one, Lane other) { return where ? one : other; }
#endif

// What a law has that needs a function of the library, or a loop. RATE: friction that depends on rate or load; WIND: of
// samples, where a run has them; DRIVE: a drive, where a run has one
enum { POWERS = 1, GRAVITY = 2, SHEDDING = 4, LAG = 8, RATE = 16, WIND = 32, DRIVE = 64, ANY = 127 };

// The coefficients of the law, by lane.
typedef struct {
  int features;  // of any lane
  const vwt_parameters* p[WIDTH];
  Lane moment_cubic, damping_quadratic, flow_angle;
  Lane lag;                    // s, in a constant wind
  Lane shedding, turn, phase;  // of the vortices in a constant wind: N m, rad/s and rad
  Lane spring, quadratic_damping, loss, cubic, quadratic, free_play, gravity, gravity_angle;
} Coefficients;

// The air's coefficients at a time: Ka and Ca (paper, eqs 4 and 5).
typedef struct {
  Lane stiffness, damping;
} Air;

// Powers of angle and rate, none negative.
typedef struct {
  Lane steepening, thickening, rate, cube, square;
} Powers;

// Whether a term has another power than that of the textbook.
INLINE int is_free(double coefficient, double exponent, double textbook) {
  return coefficient != 0 && exponent != 0 && exponent != textbook;
}

INLINE int features_of(const vwt_parameters* p, double wind) {
  const int powers = is_free(p->moment_cubic, p->moment_cubic_exponent, 2) ||
                     is_free(p->damping_quadratic, p->damping_quadratic_exponent, 2) ||
                     is_free(p->quadratic_damping, p->quadratic_damping_exponent, 2) ||
                     is_free(p->stiffness_cubic, p->stiffness_cubic_exponent, 3) ||
                     is_free(p->stiffness_quadratic, p->stiffness_quadratic_exponent, 2);
  return (powers ? POWERS : 0) | (p->gravity_stiffness != 0 ? GRAVITY : 0) |
         (p->shedding_amplitude != 0 && p->width > 0 && wind > 0 ? SHEDDING : 0) |
         (vwt_lag_time(p, wind) != 0 ? LAG : 0) |
         (p->friction_exponent != 0 || p->friction_saturation != 0 || p->friction_peak != 0 || p->friction_load != 0
              ? RATE
              : 0);
}

INLINE void set_coefficients(Coefficients* c, int k, const vwt_parameters* p) {
  const double spring = p->spring_stiffness;
  c->p[k] = p;
  AT(c->moment_cubic, k) = p->moment_cubic;
  AT(c->damping_quadratic, k) = p->damping_quadratic;
  AT(c->flow_angle, k) = p->flow_angle;
  AT(c->spring, k) = spring;
  AT(c->quadratic_damping, k) = p->quadratic_damping;
  AT(c->loss, k) = p->loss_factor != 0 ? p->loss_factor * sqrt(spring * p->yaw_inertia) : 0;  // eta Kr/wn at rest
  AT(c->cubic, k) = spring * p->stiffness_cubic;
  AT(c->quadratic, k) = spring * p->stiffness_quadratic;
  AT(c->free_play, k) = p->free_play;
  AT(c->gravity, k) = p->gravity_stiffness;
  AT(c->gravity_angle, k) = p->gravity_angle;
}

// rho V A l/2.
INLINE double flow_at(const vwt_parameters* p, double wind) {
  return wind > 0 ? 0.5 * p->air_density * wind * p->frontal_area * p->reference_length : 0;
}

INLINE void set_air(Air* air, int k, const vwt_parameters* p, double wind) {
  const double flow = flow_at(p, wind);
  AT(air->stiffness, k) = flow * wind * p->cn_beta;
  AT(air->damping, k) = flow * p->reference_length * p->cn_r;
}

// Lag and vortices in a wind.
INLINE void set_wake(Coefficients* c, int k, const vwt_parameters* p, double wind) {
  const double turns = 6.283185307179586476925286766559;
  const int sheds = p->shedding_amplitude != 0 && p->width > 0 && wind > 0;
  AT(c->lag, k) = p->aero_lag != 0 ? vwt_lag_time(p, wind) : 0;
  AT(c->shedding, k) = sheds ? flow_at(p, wind) * wind * p->shedding_amplitude : 0;
  AT(c->turn, k) = sheds ? turns * p->strouhal_number * wind / p->width : 0;
  AT(c->phase, k) = p->shedding_phase;
}

// A power of x >= 0: that of the textbook, 2 or 3, or another with the exponent of index `exponent` in the law.
INLINE Lane power_of(const Coefficients* c, int features, Lane x, int textbook, int exponent, double reference) {
  Lane out = textbook == 2 ? x * x : x * x * x;
  for (int k = 0; features & POWERS && k < WIDTH; k++) {
    const double n = ((const double*)c->p[k])[exponent];
    if (n != 0) {
      AT(out, k) = vwt_power(AT(x, k), textbook, n, reference);
    }
  }
  return out;
}

INLINE Lane power_of_angle(const Coefficients* c, int features, Lane x, int textbook, int exponent) {
  return power_of(c, features, x, textbook, exponent, VWT_ANGLE_REFERENCE);
}

// What the air sees as the body's angle: the lag's state, or for a lead its mirror image about the angle, because the
// equation of the lag is unstable with a negative time constant, or the angle itself.
INLINE Lane seen_at(const Coefficients* c, int features, Lane body, Lane lagged) {
  if (!(features & LAG) || !ACTS(c->lag)) {
    return body;
  }
  return choose(c->lag > 0, lagged, choose(c->lag < 0, 2 * body - lagged, body));
}

INLINE Lane shed_at(const Coefficients* c, Lane time) {
  Lane out = {0};
  for (int k = 0; k < WIDTH; k++) {
    if (AT(c->shedding, k) != 0) {
      AT(out, k) = AT(c->shedding, k) * sin(AT(c->turn, k) * AT(time, k) + AT(c->phase, k));
    }
  }
  return out;
}

// Moment of the air on the body, with the powers in it; `shed` and `lagged` are read only with the features they belong
// to.
INLINE Lane moment_of_air(const Coefficients* c, const Air* air, int features, Lane body, Lane rate, Lane shed,
                       Lane lagged, Powers* powers) {
  Lane steepening = (Lane){0} + 1, thickening = steepening;
  if (ACTS(c->moment_cubic)) {
    powers->steepening = power_of_angle(c, features, size_of(body), 2, VWT_INDEX_moment_cubic_exponent);
    steepening += c->moment_cubic * powers->steepening;
  }
  if (ACTS(c->damping_quadratic)) {
    powers->thickening = power_of_angle(c, features, size_of(body), 2, VWT_INDEX_damping_quadratic_exponent);
    thickening += c->damping_quadratic * powers->thickening;
  }
  const Lane moment = air->stiffness * (seen_at(c, features, body, lagged) * steepening + c->flow_angle) +
                      air->damping * thickening * rate;
  return features & SHEDDING && ACTS(c->shedding) ? moment + shed : moment;
}

// The part of the deflection that the free play takes up.
INLINE Lane taken_up(const Coefficients* c, Lane deflection) {
  const Lane above = choose(deflection < -c->free_play, -c->free_play, deflection);
  return choose(deflection > c->free_play, c->free_play, above);
}

INLINE Lane gravity_moment(const Coefficients* c, Lane angle) {
  Lane out = {0};
  for (int k = 0; k < WIDTH; k++) {
    if (AT(c->gravity, k) != 0) {
      AT(out, k) = -(AT(c->gravity, k) * sin(AT(angle, k) - AT(c->gravity_angle, k)));
    }
  }
  return out;
}

// Moment of the mechanism on the rod's upper end, without friction and without the linear spring and damper, and the
// powers in it.
INLINE Lane moment_of_mechanism(const Coefficients* c, int features, Lane angle, Lane deflection, Lane rate,
                             Powers* powers) {
  const Lane size = size_of(deflection);
  Lane moment = {0};
  if (ACTS(c->quadratic_damping)) {
    powers->rate = power_of(c, features, size_of(rate), 2, VWT_INDEX_quadratic_damping_exponent, VWT_RATE_REFERENCE);
    moment -= c->quadratic_damping * with_sign(powers->rate, rate);
  }
  if (ACTS(c->loss)) {
    moment -= c->loss * rate;
  }
  if (ACTS(c->cubic)) {
    powers->cube = power_of_angle(c, features, size, 3, VWT_INDEX_stiffness_cubic_exponent);
    moment -= c->cubic * with_sign(powers->cube, deflection);
  }
  if (ACTS(c->quadratic)) {
    powers->square = power_of_angle(c, features, size, 2, VWT_INDEX_stiffness_quadratic_exponent);
    moment -= c->quadratic * powers->square;
  }
  if (ACTS(c->free_play)) {
    moment += c->spring * taken_up(c, deflection);  // cancels the linear spring inside the dead zone
  }
  if (features & GRAVITY && ACTS(c->gravity)) {
    moment += gravity_moment(c, angle);
  }
  return moment;
}

#endif  // VWT_LAW_H_
