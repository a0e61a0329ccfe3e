// Plain runs integrated side by side, which keeps a processor's arithmetic units busy: the steps of one run wait for
// each other, those of several do not. Every operation is that of forward.c and moment.c in the same order, so that
// a run has the same bits in any company, and as an only run with its wind given as samples.

#include <math.h>

#include "step.h"

enum { POWERS = 1, GRAVITY = 2, SHEDDING = 4, LAG = 8, RATE = 16 };  // RATE: friction that depends on the rate

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

// The coefficients of the law in a constant wind, by lane.
typedef struct {
  int features;  // of any lane
  int rubs;      // whether any lane has Coulomb friction
  int count;     // of the lanes that are runs; the others repeat the first one's start
  const vwt_parameters* p[VWT_LANES];
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

int vwt_is_plain(const vwt_parameters* p, const vwt_run* run) {
  return run->wind_count == 1 && run->forcing_count == 0 && run->ambient_count == 0 && run->moment_count == 0 &&
         run->program_count == 0 && run->twist_stiffness == 0 && run->twist == 0 && run->twist_rate == 0 && !(p->presliding > 0);
}

int vwt_alike(const vwt_run* one, const vwt_run* other) {
  return one->steps == other->steps && one->stride == other->stride && one->samples == other->samples;
}

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
  const int own = features_of(p, wind);
  c->features |= own;
  c->rubs |= p->friction_moment > 0;
  c->p[k] = p;
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

// Angular acceleration at a motion; `shed` and `lagged` are read only with the features they belong to.
INLINE Lane acceleration(const Coefficients* c, Lane slip, int features, Lane angle, Lane rate, Lane shed,
                                Lane lagged) {
  const Lane body = c->body * angle;
  Powers powers;
  set_powers(c, size_of(body), size_of(angle), size_of(rate), features & POWERS, &powers);
  Lane seen = body;
  if (features & LAG) {
    seen = choose(c->lag > 0, lagged, choose(c->lag < 0, 2 * body - lagged, body));
  }
  const Lane steepening = 1 + c->moment_cubic * powers.steepening;
  const Lane thickening = 1 + c->damping_quadratic * powers.thickening;
  Lane air = c->air_stiffness * (seen * steepening + c->flow_angle) +
             c->air_damping * thickening * (c->body * rate);
  if (features & SHEDDING) {
    air += shed;
  }
  Lane moment = -(c->quadratic_damping * with_sign(powers.rate, rate));
  moment -= c->loss * rate;
  moment -= c->cubic * with_sign(powers.cube, angle);
  moment -= c->quadratic * powers.square;
  const Lane above = choose(angle < -c->free_play, -c->free_play, angle);
  moment += c->spring * choose(angle > c->free_play, c->free_play, above);
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

// The motion after a step.
INLINE void runge_kutta(const Coefficients* c, const State* s, int features, Lane* angle, Lane* rate) {
  const Lane h = c->whole_step, half = c->half_step, none = {0};
  const int sheds = features & SHEDDING, lags = features & LAG;
  Lane shed = sheds ? shed_at(c, s->start) : none;
  const Lane a1 = acceleration(c, s->slip, features, s->angle, s->rate, shed, s->lagged);
  const Lane y2 = s->angle + half * s->rate, r2 = s->rate + half * a1;
  shed = sheds ? shed_at(c, s->start + half) : none;
  Lane lagged = lags ? lagged_at(c, s, c->half, half, y2, r2) : none;
  const Lane a2 = acceleration(c, s->slip, features, y2, r2, shed, lagged);
  const Lane y3 = s->angle + half * r2, r3 = s->rate + half * a2;
  lagged = lags ? lagged_at(c, s, c->half, half, y3, r3) : none;
  const Lane a3 = acceleration(c, s->slip, features, y3, r3, shed, lagged);
  const Lane y4 = s->angle + h * r3, r4 = s->rate + h * a3;
  shed = sheds ? shed_at(c, s->start + h) : none;
  lagged = lags ? lagged_at(c, s, c->whole, h, y4, r4) : none;
  const Lane a4 = acceleration(c, s->slip, features, y4, r4, shed, lagged);
  *angle = s->angle + h * ((s->rate + 2 * (r2 + r3) + r4) / 6);
  *rate = s->rate + h * ((a1 + 2 * (a2 + a3) + a4) / 6);
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

INLINE void step(const Coefficients* c, State* s, int features, Step* alone) {
  const State before = *s;
  runge_kutta(c, &before, features, &s->angle, &s->rate);
  if (features & LAG) {
    s->lagged = lagged_at(c, &before, c->whole, c->whole_step, s->angle, s->rate);
  }
  if (!c->rubs) {
    return;
  }
  const Mask slides = (before.rate != 0) & (s->rate * before.slip > 0), turns = (c->friction > 0) & ~slides;
  if (!any(turns)) {
    return;
  }
  for (int k = 0; k < c->count; k++) {
    if (turns[k]) {
      s->angle[k] = before.angle[k];
      s->rate[k] = before.rate[k];
      s->lagged[k] = before.lagged[k];
      if (!before.rests[k]) {
        step_alone(c, s, k, &alone[k]);
      }
    }
  }
}

// Samples within a step, as vwt_fill.
INLINE void fill(const Coefficients* c, const State* from, const State* to, int stride, int at, int samples,
                 double* const* angle, double* const* rate) {
  const Lane h = c->whole_step, change = to->angle - from->angle;
  const Lane c1 = h * from->rate;
  const Lane c2 = 3 * change - h * (2 * from->rate + to->rate);
  const Lane c3 = h * (from->rate + to->rate) - 2 * change;
  for (int j = 1; j < stride && at + j < samples; j++) {
    const double u = j / (double)stride;
    const Lane angles = from->angle + u * (c1 + u * (c2 + u * c3));
    const Lane rates = (c1 + u * (2 * c2 + u * 3 * c3)) / h;
    for (int k = 0; k < c->count; k++) {
      angle[k][at + j] = angles[k];
      rate[k][at + j] = rates[k];
    }
  }
}

INLINE int integrate(const Coefficients* c, State* s, int features, int count, Step* alone,
                            const vwt_run* like, double* const* angle, double* const* rate) {
  const int samples = (int)like->samples, steps = (int)like->steps;
  const int stride = like->stride > 1 && steps == 1 ? (int)like->stride : 1;
  int failed = VWT_LANES;  // the first lane whose motion grew without bound
  for (int i = 0; i < samples; i += stride) {
    const State before = *s;
    for (int k = 0; k < count; k++) {
      angle[k][i] = before.angle[k];
      rate[k][i] = before.rate[k];
    }
    for (int j = 0; j < steps; j++) {
      step(c, s, features, alone);
      s->start = (i * (double)steps + stride * (j + 1)) * c->step;  // no drift of the clock
    }
    if (stride > 1) {
      fill(c, &before, s, stride, i, samples, angle, rate);
    }
    if (any(~(size_of(s->angle) < 1e6))) {
      for (int k = count - 1; k >= 0; k--) {
        failed = !(fabs(s->angle[k]) < 1e6) && k < failed ? k : failed;
      }
    }
    if (failed == 0) {
      break;
    }
  }
  return failed < VWT_LANES ? 1 + failed : 0;
}

CLONED int vwt_integrate_lanes(int count, const vwt_parameters* parameters, const vwt_run* runs,
                               double* const* angle, double* const* rate) {
  Coefficients c = {.count = count};
  State s = {.rests = {0}};
  LagWeights weights[VWT_LANES] = {{{0}, {{0}}, 0}};
  Step alone[VWT_LANES];
  for (int k = 0; k < VWT_LANES; k++) {
    const int i = k < count ? k : 0;  // a lane too many repeats the first run
    set_lane(&c, k, &parameters[i], &runs[i]);
    alone[k] = vwt_release(&parameters[i], &runs[i], &weights[k]);
    s.start[k] = 0;
    s.angle[k] = alone[k].from.angle;
    s.rate[k] = alone[k].from.rate;
    s.lagged[k] = alone[k].lagged;
    s.slip[k] = parameters[i].friction_moment > 0 ? alone[k].slip : 0;
  }
  // the law of most runs has none of the features that need a function of the library
  return c.features == 0 ? integrate(&c, &s, 0, count, alone, runs, angle, rate)
                         : integrate(&c, &s, c.features, count, alone, runs, angle, rate);
}
