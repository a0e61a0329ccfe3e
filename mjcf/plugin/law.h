// The moment law, written once for every width: one run, or LAW_LANES runs side by side. A file includes it for one
// width. Both widths do the same operations in the same order, so that their bits are the same but for elementary
// functions.
// A term whose coefficient is zero vanishes: one run skips it, lanes add zero.

#ifndef VWT_LAW_H_
#define VWT_LAW_H_

#include <math.h>

#include "elementary.h"
#include "lag.h"
#include "lane.h"
#include "parameters.h"

// What a law has that takes long: an elementary function, or a loop. The first five: powers with a free exponent; ROOT,
// SATURATION, PEAK and LOAD: of the friction; WIND: of samples; DRIVE: a drive; TWIST: a rod that twists; DAHL:
// Dahl's friction; PROGRAM: a moment by expression; FORCED: turbulence, or a moment of the surroundings
enum {
  STEEPENING = 1,
  THICKENING = 2,
  RATE_POWER = 4,
  CUBE = 8,
  SQUARE = 16,
  GRAVITY = 32,
  SHEDDING = 64,
  LAG = 128,
  ROOT = 256,
  SATURATION = 512,
  PEAK = 1024,
  LOAD = 2048,
  RATE = ROOT | SATURATION | PEAK | LOAD,
  WIND = 4096,
  DRIVE = 8192,
  TWIST = 16384,
  DAHL = 32768,
  PROGRAM = 65536,
  FORCED = 131072,
  ANY = 262143
};

// The coefficients of the law, by lane.
typedef struct {
  int features;  // of any lane
  const vwt_parameters* p[WIDTH];
  Lane moment_cubic, damping_quadratic, flow_angle;
  Lane steepening, thickening, rate, cube, square;  // free exponents; 0: that of the textbook
  Lane phase;                                       // rad, of the vortices
  Lane spring, quadratic_damping, loss, cubic, quadratic, free_play, gravity, gravity_angle;
} Coefficients;

// The friction's coefficients, with the ranges of rates that act; 0 where a factor is one.
typedef struct {
  Lane moment, load, exponent, saturation, peak, peak_rate;
} Friction;

// The air's coefficients at a time: Ka and Ca (paper, eqs 4 and 5).
typedef struct {
  Lane stiffness, damping;
} Air;

// Lag and vortices at a time: s, N m and rad/s.
typedef struct {
  Lane lag, shedding, turn;
} Wake;

// Powers of angle and rate, none negative.
typedef struct {
  Lane steepening, thickening, rate, cube, square;
} Powers;

// Whether a power has another exponent than that of the textbook.
INLINE int is_free(double exponent, double textbook) { return exponent != 0 && exponent != textbook; }

INLINE double exponent_of(double exponent, double textbook) { return is_free(exponent, textbook) ? exponent : 0; }

// The powers with free exponents, whether or not their coefficients are zero.
INLINE int free_powers(const vwt_parameters* p) {
  return (is_free(p->moment_cubic_exponent, 2) ? STEEPENING : 0) |
         (is_free(p->damping_quadratic_exponent, 2) ? THICKENING : 0) |
         (is_free(p->quadratic_damping_exponent, 2) ? RATE_POWER : 0) |
         (is_free(p->stiffness_cubic_exponent, 3) ? CUBE : 0) |
         (is_free(p->stiffness_quadratic_exponent, 2) ? SQUARE : 0);
}

INLINE int features_of(const vwt_parameters* p, double wind) {
  const int moves = (p->moment_cubic != 0 ? STEEPENING : 0) | (p->damping_quadratic != 0 ? THICKENING : 0) |
                    (p->quadratic_damping != 0 ? RATE_POWER : 0) | (p->stiffness_cubic != 0 ? CUBE : 0) |
                    (p->stiffness_quadratic != 0 ? SQUARE : 0);
  return (free_powers(p) & moves) | (p->gravity_stiffness != 0 ? GRAVITY : 0) |
         (p->shedding_amplitude != 0 && p->width > 0 && wind > 0 ? SHEDDING : 0) |
         (vwt_lag_time(p, wind) != 0 ? LAG : 0) |
         (p->friction_exponent != 0 ? ROOT : 0) | (p->friction_saturation != 0 ? SATURATION : 0) |
         (p->friction_peak_rate != 0 ? PEAK : 0) | (p->friction_load != 0 ? LOAD : 0);
}

INLINE void set_coefficients(Coefficients* c, int k, const vwt_parameters* p) {
  const double spring = p->spring_stiffness;
  c->p[k] = p;
  AT(c->moment_cubic, k) = p->moment_cubic;
  AT(c->damping_quadratic, k) = p->damping_quadratic;
  AT(c->flow_angle, k) = p->flow_angle;
  AT(c->steepening, k) = exponent_of(p->moment_cubic_exponent, 2);
  AT(c->thickening, k) = exponent_of(p->damping_quadratic_exponent, 2);
  AT(c->rate, k) = exponent_of(p->quadratic_damping_exponent, 2);
  AT(c->cube, k) = exponent_of(p->stiffness_cubic_exponent, 3);
  AT(c->square, k) = exponent_of(p->stiffness_quadratic_exponent, 2);
  AT(c->phase, k) = p->shedding_phase;
  AT(c->spring, k) = spring;
  AT(c->quadratic_damping, k) = p->quadratic_damping;
  AT(c->loss, k) = p->loss_factor != 0 ? p->loss_factor * sqrt(spring * p->yaw_inertia) : 0;  // eta Kr/wn at rest
  AT(c->cubic, k) = spring * p->stiffness_cubic;
  AT(c->quadratic, k) = spring * p->stiffness_quadratic;
  AT(c->free_play, k) = p->free_play;
  AT(c->gravity, k) = p->gravity_stiffness;
  AT(c->gravity_angle, k) = p->gravity_angle;
}

// With ranges of rates of at least `least`.
INLINE void set_friction(Friction* f, int k, const vwt_parameters* p, double least) {
  AT(f->moment, k) = p->friction_moment;
  AT(f->load, k) = p->friction_load;
  AT(f->exponent, k) = p->friction_exponent;
  AT(f->saturation, k) = p->friction_saturation != 0 ? fmax(p->friction_saturation, least) : 0;
  AT(f->peak, k) = p->friction_peak;
  AT(f->peak_rate, k) = p->friction_peak_rate != 0 ? fmax(p->friction_peak_rate, least) : 0;
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

INLINE void set_wake(Wake* wake, int k, const vwt_parameters* p, double wind) {
  const double turns = 6.283185307179586476925286766559;
  const int sheds = p->shedding_amplitude != 0 && p->width > 0 && wind > 0;
  AT(wake->lag, k) = p->aero_lag != 0 ? vwt_lag_time(p, wind) : 0;
  AT(wake->shedding, k) = sheds ? flow_at(p, wind) * wind * p->shedding_amplitude : 0;
  AT(wake->turn, k) = sheds ? turns * p->strouhal_number * wind / p->width : 0;
}

// A power of x >= 0: that of the textbook, 2 or 3, or, where some are free, one with another exponent, equal at the
// reference.
INLINE Lane power_of(int free, Lane x, int textbook, Lane exponent, double reference) {
  const Lane plain = textbook == 2 ? x * x : x * x * x;
  if (!free || !ACTS(exponent)) {
    return plain;
  }
  const double scale = textbook == 2 ? reference * reference : reference * reference * reference;
  return choose(exponent != 0, scale * power(x * (1 / reference), exponent), plain);
}

INLINE Lane power_of_angle(int free, Lane x, int textbook, Lane exponent) {
  return power_of(free, x, textbook, exponent, VWT_ANGLE_REFERENCE);
}

// What the air sees as the body's angle: the lag's state, or for a lead its mirror image about the angle, because the
// equation of the lag is unstable with a negative time constant, or the angle itself.
INLINE Lane seen_at(const Wake* wake, int features, Lane body, Lane lagged) {
  if (!(features & LAG) || !ACTS(wake->lag)) {
    return body;
  }
  return choose(wake->lag > 0, lagged, choose(wake->lag < 0, 2 * body - lagged, body));
}

INLINE Lane shed_at(const Coefficients* c, const Wake* wake, Lane time) {
  return ACTS(wake->shedding) ? wake->shedding * sine(wake->turn * time + c->phase) : (Lane){0};
}

// Moment of the air on the body, with the powers in it; `shed` and `lagged` are read only with the features they belong
// to.
INLINE Lane moment_of_air(const Coefficients* c, const Air* air, const Wake* wake, int features, Lane body, Lane rate,
                          Lane shed, Lane lagged, Powers* powers) {
  Lane steepening = (Lane){0} + 1, thickening = steepening;
  if (ACTS(c->moment_cubic)) {
    powers->steepening = power_of_angle(features & STEEPENING, size_of(body), 2, c->steepening);
    steepening += c->moment_cubic * powers->steepening;
  }
  if (ACTS(c->damping_quadratic)) {
    powers->thickening = power_of_angle(features & THICKENING, size_of(body), 2, c->thickening);
    thickening += c->damping_quadratic * powers->thickening;
  }
  const Lane moment = air->stiffness * (seen_at(wake, features, body, lagged) * steepening + c->flow_angle) +
                      air->damping * thickening * rate;
  return features & SHEDDING && ACTS(wake->shedding) ? moment + shed : moment;
}

// The part of the deflection that the free play takes up.
INLINE Lane taken_up(const Coefficients* c, Lane deflection) {
  const Lane above = choose(deflection < -c->free_play, -c->free_play, deflection);
  return choose(deflection > c->free_play, c->free_play, above);
}

// Moment of the mechanism on the rod's upper end, without friction and without the linear spring and damper, and the
// powers in it.
INLINE Lane moment_of_mechanism(const Coefficients* c, int features, Lane angle, Lane deflection, Lane rate,
                             Powers* powers) {
  const Lane size = size_of(deflection);
  Lane moment = {0};
  if (ACTS(c->quadratic_damping)) {
    powers->rate = power_of(features & RATE_POWER, size_of(rate), 2, c->rate, VWT_RATE_REFERENCE);
    moment -= c->quadratic_damping * with_sign(powers->rate, rate);
  }
  if (ACTS(c->loss)) {
    moment -= c->loss * rate;
  }
  if (ACTS(c->cubic)) {
    powers->cube = power_of_angle(features & CUBE, size, 3, c->cube);
    moment -= c->cubic * with_sign(powers->cube, deflection);
  }
  if (ACTS(c->quadratic)) {
    powers->square = power_of_angle(features & SQUARE, size, 2, c->square);
    moment -= c->quadratic * powers->square;
  }
  if (ACTS(c->free_play)) {
    moment += c->spring * taken_up(c, deflection);  // cancels the linear spring inside the dead zone
  }
  if (features & GRAVITY && ACTS(c->gravity)) {
    moment -= c->gravity * sine(angle - c->gravity_angle);
  }
  return moment;
}

// The factors of the friction at a rate along the slip, 1 where it has none: of the rate's power, the saturation and
// the peak, and the peak's own shape.
typedef struct {
  Lane power, turn, peak, shape;
} Factors;

INLINE Factors factors_of(const Friction* f, int features, Lane along) {
  const Lane none = {0}, one = none + 1;
  Factors out = {one, one, one, none};
  if (features & ROOT && ACTS(f->exponent)) {
    out.power = choose(f->exponent != 0, power(size_of(along) * (1 / VWT_RATE_REFERENCE), f->exponent), one);
  }
  if (features & SATURATION && ACTS(f->saturation)) {
    const Mask acts = f->saturation > 0;
    out.turn = choose(acts, hyperbolic_tangent(along / choose(acts, f->saturation, one)), one);
  }
  if (features & PEAK && ACTS(f->peak_rate)) {
    const Mask acts = f->peak_rate > 0;
    const Lane share = along / choose(acts, f->peak_rate, one);
    out.shape = choose(acts, exponential(-share * share), none);
    out.peak = 1 + f->peak * out.shape;
  }
  return out;
}

// As vwt_friction_level.
INLINE Lane friction_level(const Friction* f, int features, Lane along, Lane load) {
  const Factors factors = factors_of(f, features, along);
  return (f->moment + f->load * load) * factors.power * factors.turn * factors.peak;
}

// Dahl's deflection after a motion over `distance` in the direction `side`, 1 or -1.
INLINE Lane slid(Lane range, Lane deflection, Lane side, Lane distance) {
#ifdef LAW_LANES
  const Lane end = side * range, moved = end + (deflection - end) * exponential(-distance / range);
  return choose(distance > 0, moved, deflection);
#else
  return distance > 0 ? deflection - (side * range - deflection) * expm1(-distance / range) : deflection;
#endif
}

// Dahl's deflection after `duration`, as vwt_presliding_advance.
INLINE Lane deflection_after(Lane range, Lane deflection, Lane duration, Lane angle0, Lane rate0, Lane angle1,
                             Lane rate1) {
  const Lane none = {0}, one = none + 1, change = angle1 - angle0;
  const Mask forwards = (rate0 > 0) | ((rate0 == 0) & (change > 0)), reverses = rate0 * rate1 < 0;
  // The distance after the reversal is computed from the end of the step, so that the deflection is a smooth function
  // of the end point. The stages of the Runge-Kutta method, which do not lie on one path, need this.
  const Lane side = choose(forwards, one, -one), apart = choose(reverses, size_of(rate1 - rate0), one);
  const Lane back = choose(reverses, duration * rate1 * rate1 / (2 * apart), none);
  return slid(range, slid(range, deflection, side, side * change + back), -side, back);
}

#endif  // VWT_LAW_H_
