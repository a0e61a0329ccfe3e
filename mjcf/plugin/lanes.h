// The moment law in several lanes at once, which lanes.c and slopes.c share. Every operation is that of forward.c and
// moment.c in the same order.

#ifndef VWT_LANES_H_
#define VWT_LANES_H_

#include <math.h>

#include "step.h"

// RATE: friction that depends on the rate; WIND: of samples
enum { POWERS = 1, GRAVITY = 2, SHEDDING = 4, LAG = 8, RATE = 16, WIND = 32 };

// Compiled for wide registers too, among which the loader chooses: no operation is fused, so the bits are the same.
#if VWT_WIDE
#define CLONED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLONED
#endif
#define INLINE static inline __attribute__((always_inline))  // into every clone

// A number by lane, with the vector extension of GCC and Clang, and what a comparison of two gives: all bits or none.
typedef double Lane __attribute__((vector_size(8 * VWT_LANES)));
typedef long long Mask __attribute__((vector_size(8 * VWT_LANES)));

// The coefficients of the law, by lane; those of the air in a constant wind.
typedef struct {
  int features;  // of any lane
  int rubs;      // whether any lane has Coulomb friction
  int count;     // of the lanes that are runs; the others repeat the first one's start
  const vwt_parameters* p[VWT_LANES];
  const vwt_run* run[VWT_LANES];
  Lane step, whole_step, half_step, body, inertia, spring, damping, rod, friction, least_rate;
  Lane air_stiffness, air_damping, moment_cubic, damping_quadratic, flow_angle;
  Lane quadratic_damping, loss, cubic, quadratic, free_play, gravity, gravity_angle;
  Lane shedding, shedding_turn, shedding_phase;
  Lane lag;
  double half[VWT_LANES][4], whole[VWT_LANES][4];  // weights of the lag
} Coefficients;

// The start of a step, by lane.
typedef struct {
  Lane start, angle, rate, lagged, slip;
  int rests[VWT_LANES];
} State;

// Whether a term has another power than that of the textbook.
static int is_free(double coefficient, double exponent, double textbook) {
  return coefficient != 0 && exponent != 0 && exponent != textbook;
}

static int features_of(const vwt_parameters* p, double wind) {
  const int powers = is_free(p->moment_cubic, p->moment_cubic_exponent, 2) ||
                     is_free(p->damping_quadratic, p->damping_quadratic_exponent, 2) ||
                     is_free(p->quadratic_damping, p->quadratic_damping_exponent, 2) ||
                     is_free(p->stiffness_cubic, p->stiffness_cubic_exponent, 3) ||
                     is_free(p->stiffness_quadratic, p->stiffness_quadratic_exponent, 2);
  return (powers ? POWERS : 0) | (p->gravity_stiffness != 0 ? GRAVITY : 0) |
         (p->shedding_amplitude != 0 && p->width > 0 && wind > 0 ? SHEDDING : 0) |
         (vwt_lag_time(p, wind) != 0 ? LAG : 0) |
         (p->friction_exponent != 0 || p->friction_saturation != 0 || p->friction_peak != 0 ? RATE : 0);
}

static void set_lane(Coefficients* c, int k, const vwt_parameters* p, const vwt_run* run) {
  const double wind = fmax(0, run->wind[0]), turns = 6.283185307179586476925286766559;
  const double flow = wind > 0 ? 0.5 * p->air_density * wind * p->frontal_area * p->reference_length : 0;
  const double scale = flow * wind;
  const int stride = run->stride > 1 && run->steps == 1 ? (int)run->stride : 1;
  const int own = features_of(p, wind) | (run->wind_count > 1 ? WIND : 0);
  c->features |= own;
  c->rubs |= p->friction_moment > 0;
  c->p[k] = p;
  c->run[k] = run;
  c->step[k] = run->step;
  c->whole_step[k] = stride * run->step;
  c->half_step[k] = c->whole_step[k] / 2;
  c->body[k] = 1 + run->lead;
  c->rod[k] = run->rod_stiffness;
  c->inertia[k] = p->yaw_inertia;
  c->spring[k] = p->spring_stiffness;
  c->damping[k] = p->mechanical_damping;
  c->friction[k] = p->friction_moment;
  c->least_rate[k] = vwt_friction_least_rate(p, p->yaw_inertia, run->step);
  c->air_stiffness[k] = scale * p->cn_beta;
  c->air_damping[k] = flow * p->reference_length * p->cn_r;
  c->moment_cubic[k] = p->moment_cubic;
  c->damping_quadratic[k] = p->damping_quadratic;
  c->flow_angle[k] = p->flow_angle;
  c->quadratic_damping[k] = p->quadratic_damping;
  c->loss[k] = p->loss_factor * sqrt(p->spring_stiffness * p->yaw_inertia);
  c->cubic[k] = p->spring_stiffness * p->stiffness_cubic;
  c->quadratic[k] = p->spring_stiffness * p->stiffness_quadratic;
  c->free_play[k] = p->free_play;
  c->gravity[k] = p->gravity_stiffness;
  c->gravity_angle[k] = p->gravity_angle;
  c->shedding[k] = own & SHEDDING ? scale * p->shedding_amplitude : 0;
  c->shedding_turn[k] = own & SHEDDING ? turns * p->strouhal_number * wind / p->width : 0;
  c->shedding_phase[k] = p->shedding_phase;
  c->lag[k] = vwt_lag_time(p, wind);
  if (c->lag[k] != 0) {
    vwt_lag_weights(c->half_step[k] / fabs(c->lag[k]), c->half[k]);
    vwt_lag_weights(c->whole_step[k] / fabs(c->lag[k]), c->whole[k]);
  }
}

INLINE Mask sign(void) { return (Mask)(-(Lane){0}); }  // its bit alone
INLINE Lane size_of(Lane x) { return (Lane)((Mask)x & ~sign()); }
INLINE Lane with_sign(Lane size, Lane x) { return (Lane)((Mask)size | ((Mask)x & sign())); }
INLINE Lane choose(Mask where, Lane one, Lane other) {
  return (Lane)((where & (Mask)one) | (~where & (Mask)other));
}

INLINE long long any(Mask where) {
  long long out = 0;
  for (int k = 0; k < VWT_LANES; k++) {
    out |= where[k];
  }
  return out;
}

// Powers of angle and rate, none negative.
typedef struct {
  Lane steepening, thickening, rate, cube, square;
} Powers;

INLINE void set_powers(const Coefficients* c, Lane body, Lane angle, Lane rate, int free, Powers* out) {
  if (!free) {
    out->steepening = out->thickening = body * body;
    out->rate = rate * rate;
    out->square = angle * angle;
    out->cube = out->square * angle;
    return;
  }
  for (int k = 0; k < VWT_LANES; k++) {
    const vwt_parameters* p = c->p[k];
    out->steepening[k] = vwt_power_of_angle(body[k], 2, p->moment_cubic_exponent);
    out->thickening[k] = vwt_power_of_angle(body[k], 2, p->damping_quadratic_exponent);
    out->rate[k] = vwt_power_of_rate(rate[k], p->quadratic_damping_exponent);
    out->cube[k] = vwt_power_of_angle(angle[k], 3, p->stiffness_cubic_exponent);
    out->square[k] = vwt_power_of_angle(angle[k], 2, p->stiffness_quadratic_exponent);
  }
}

// The air's coefficients at a time.
typedef struct {
  Lane stiffness, damping;
} Air;

INLINE Air air_at(const Coefficients* c, int features, Lane time) {
  Air out = {c->air_stiffness, c->air_damping};
  for (int k = 0; features & WIND && k < VWT_LANES; k++) {
    const vwt_run* run = c->run[k];
    const vwt_parameters* p = c->p[k];
    const double wind = fmax(0, vwt_series(run->wind, (int)run->wind_count, run->wind_interval, time[k]));
    const double flow = 0.5 * p->air_density * wind * p->frontal_area * p->reference_length;
    out.stiffness[k] = flow * wind * p->cn_beta;
    out.damping[k] = flow * p->reference_length * p->cn_r;
  }
  return out;
}

// What the air sees as the body's angle: the lag's state, its mirror image about the angle, or the angle itself.
INLINE Lane seen_at(const Coefficients* c, int features, Lane body, Lane lagged) {
  return features & LAG ? choose(c->lag > 0, lagged, choose(c->lag < 0, 2 * body - lagged, body)) : body;
}

// The part of the deflection that the free play takes up.
INLINE Lane taken_up(const Coefficients* c, Lane angle) {
  const Lane above = choose(angle < -c->free_play, -c->free_play, angle);
  return choose(angle > c->free_play, c->free_play, above);
}

// Angular acceleration at a motion; `shed` and `lagged` are read only with the features they belong to.
INLINE Lane acceleration(const Coefficients* c, const Air* flow, const Powers* powers, Lane slip, int features,
                         Lane angle, Lane rate, Lane shed, Lane lagged) {
  const Lane body = c->body * angle;
  const Lane seen = seen_at(c, features, body, lagged);
  const Lane steepening = 1 + c->moment_cubic * powers->steepening;
  const Lane thickening = 1 + c->damping_quadratic * powers->thickening;
  Lane air = flow->stiffness * (seen * steepening + c->flow_angle) +
             flow->damping * thickening * (c->body * rate);
  if (features & SHEDDING) {
    air += shed;
  }
  Lane moment = -(c->quadratic_damping * with_sign(powers->rate, rate));
  moment -= c->loss * rate;
  moment -= c->cubic * with_sign(powers->cube, angle);
  moment -= c->quadratic * powers->square;
  moment += c->spring * taken_up(c, angle);
  if (features & GRAVITY) {
    for (int k = 0; k < VWT_LANES; k++) {
      moment[k] -= c->gravity[k] != 0 ? c->gravity[k] * sin(angle[k] - c->gravity_angle[k]) : 0;
    }
  }
  moment = moment - c->spring * angle - c->damping * rate;
  moment = moment + c->body * air - c->rod * angle;
  Lane friction = c->friction;
  if (features & RATE) {
    for (int k = 0; k < VWT_LANES; k++) {
      friction[k] = vwt_friction_level(c->p[k], c->least_rate[k], slip[k] * rate[k]);
    }
  }
  return (moment - slip * friction) / c->inertia;
}

INLINE Lane acceleration_at(const Coefficients* c, const Air* flow, Lane slip, int features, Lane angle, Lane rate,
                            Lane shed, Lane lagged) {
  Powers powers;
  set_powers(c, size_of(c->body * angle), size_of(angle), size_of(rate), features & POWERS, &powers);
  return acceleration(c, flow, &powers, slip, features, angle, rate, shed, lagged);
}

INLINE Lane shed_at(const Coefficients* c, Lane time) {
  Lane out = {0};
  for (int k = 0; k < VWT_LANES; k++) {
    if (c->shedding[k] != 0) {
      out[k] = c->shedding[k] * sin(c->shedding_turn[k] * time[k] + c->shedding_phase[k]);
    }
  }
  return out;
}

INLINE Lane lagged_at(const Coefficients* c, const State* s, const double weights[][4], Lane duration,
                             Lane angle, Lane rate) {
  const Lane angle0 = c->body * s->angle, rate0 = c->body * s->rate, angle1 = c->body * angle, rate1 = c->body * rate;
  Lane out = {0};
  for (int k = 0; k < VWT_LANES; k++) {
    if (c->lag[k] != 0) {
      out[k] = vwt_lag_weighted(weights[k], s->lagged[k], duration[k], angle0[k], rate0[k], angle1[k], rate1[k]);
    }
  }
  return out;
}

// The lanes that have Coulomb friction and do not slide on throughout a step: the others have moved as the step says.
INLINE Mask turning(const Coefficients* c, const State* before, Lane rate) {
  const Mask slides = (before->rate != 0) & (rate * before->slip > 0);
  return (c->friction > 0) & ~slides;
}

// A step of one lane that reverses or sticks under Coulomb friction. Where it changes nothing in a steady law, the lane
// rests for good.
static void step_alone(const Coefficients* c, State* s, int k, Step* alone) {
  const double angle = s->angle[k], rate = s->rate[k], lagged = s->lagged[k];
  alone->start = s->start[k];
  alone->from.angle = s->angle[k];
  alone->from.rate = s->rate[k];
  alone->lagged = s->lagged[k];
  alone->slip = (int)s->slip[k];
  vwt_step_with_friction(alone, c->whole_step[k]);
  s->angle[k] = alone->from.angle;
  s->rate[k] = alone->from.rate;
  s->lagged[k] = alone->lagged;
  s->slip[k] = alone->slip;
  const int changed = s->rate[k] != 0 || rate != 0 || s->angle[k] != angle || s->lagged[k] != lagged;
  s->rests[k] = !changed && c->shedding[k] == 0;
}

// Up to `VWT_LANES` runs at their start.
static void release(int count, const vwt_parameters* parameters, const vwt_run* runs, Coefficients* c, State* s,
                    Step* alone, LagWeights* weights) {
  for (int k = 0; k < VWT_LANES; k++) {
    const int i = k < count ? k : 0;  // a lane too many repeats the first run
    set_lane(c, k, &parameters[i], &runs[i]);
    alone[k] = vwt_release(&parameters[i], &runs[i], &weights[k]);
    s->start[k] = 0;
    s->angle[k] = alone[k].from.angle;
    s->rate[k] = alone[k].from.rate;
    s->lagged[k] = alone[k].lagged;
    s->slip[k] = parameters[i].friction_moment > 0 ? alone[k].slip : 0;
  }
}

#endif  // VWT_LANES_H_
