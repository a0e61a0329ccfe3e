// The terms of a plain run's acceleration, and its derivatives by them and by the motion at a stage of a step.

#ifndef VWT_STAGES_H_
#define VWT_STAGES_H_

#include <math.h>

#include "lanes.h"

// Exponents that act, the inverse of the inertia, what turns the air's terms into those of the angle, and the law; also
// the changes of samples.
typedef struct {
  const Runs* c;
  int features;
  const double* changes[VWT_LANES];
  Lane inverse;
  Lane steepening, thickening, rate, cube, square;
  Lane seen, steep, thick;
} Law;

// The derivatives of the lag's state at a step's end or middle, by the state, angle and rate at its start, by angle and
// rate there, and of its weights by the lag.
typedef struct {
  Lane lagged, angle0, rate0, angle1, rate1, weights[4];
  vwt_lag lag[VWT_LANES];
} LagSlopes;

// A stage of a step, and the derivatives of the acceleration there.
typedef struct {
  Lane angle, rate, time, seen, input, deflection;
  Air air;
  Powers powers;
  Lane speed, pressure;  // of a wind of samples, m/s and (m/s)2; 1 in a constant wind
  Lane by_speed;         // of the acceleration, in a wind of samples
  Lane by_input;         // of the acceleration, in a driven run
  Lane by_angle, by_rate, by_lagged, by_lag;
  Lane level;              // of the friction per unit of its moment
  Lane by_friction[4];     // of the acceleration by exponent, saturation, peak rate and peak
} Slopes;

// A small change of the motion by column, per unit of the column's term.
enum { VWT_MOST_COLUMNS = VWT_TERM_COUNT + VWT_MOST_CHANGES };
typedef struct {
  Lane angle[VWT_MOST_COLUMNS], rate[VWT_MOST_COLUMNS], lagged[VWT_MOST_COLUMNS];
} Change;

static int is_sampled(const Runs* c, int k) { return c->run[k]->wind_count > 1; }

static int is_driven(const Runs* c, int k) { return c->run[k]->moment_count > 0; }

// What the air's stiffness and damping have in common with those at any other speed, kg/m; times the model's length.
static double flow_of(const vwt_parameters* p) {
  return 0.5 * p->air_density * p->frontal_area * p->reference_length;
}

static double acting(double exponent, double textbook) { return exponent != 0 ? exponent : textbook; }

static Law law_of(const Runs* c) {
  Law law = {.c = c, .features = c->law.features, .inverse = 1 / c->inertia};
  for (int k = 0; k < VWT_LANES; k++) {
    const vwt_parameters* p = c->law.p[k];
    const double body = c->body[k];
    law.steepening[k] = acting(p->moment_cubic_exponent, 2);
    law.thickening[k] = acting(p->damping_quadratic_exponent, 2);
    law.rate[k] = acting(p->quadratic_damping_exponent, 2);
    law.cube[k] = acting(p->stiffness_cubic_exponent, 3);
    law.square[k] = acting(p->stiffness_quadratic_exponent, 2);
    law.seen[k] = 1 / body;
    law.steep[k] = body != 1 ? pow(body, -1 - law.steepening[k]) : 1;
    law.thick[k] = body != 1 ? pow(body, -law.thickening[k]) : 1;
    law.features |= free_powers(p);  // also where the coefficient is zero, by which there is a derivative
  }
  return law;
}

INLINE LagSlopes lag_slopes(const Runs* c, Lane duration) {
  LagSlopes out = {0};
  for (int k = 0; k < VWT_LANES; k++) {
    const double time = c->wake.lag[k], h = duration[k], *w = out.lag[k].w;
    double slopes[4];
    if (time == 0) {
      continue;
    }
    vwt_set_lag(&out.lag[k], time, h);
    vwt_lag_weight_slopes(&out.lag[k], slopes);
    out.lagged[k] = 1 - w[0];
    out.angle0[k] = c->body[k] * (w[0] - 3 * w[2] + 2 * w[3]);
    out.rate0[k] = c->body[k] * h * (w[1] - 2 * w[2] + w[3]);
    out.angle1[k] = c->body[k] * (3 * w[2] - 2 * w[3]);
    out.rate1[k] = c->body[k] * h * (w[3] - w[2]);
    for (int n = 0; n < 4; n++) {
      out.weights[n][k] = -slopes[n] * out.lag[k].ratio / time;  // dz/dlag, whose sign is that of a lead too
    }
  }
  return out;
}

// The derivative of the lag's state by the lag, over a path from the step's start.
INLINE Lane by_lag(const Runs* c, const State* s, const LagSlopes* l, Lane h, Lane angle, Lane rate) {
  const Lane change = c->body * (angle - s->y.angle), rate0 = c->body * s->y.rate, rate1 = c->body * rate;
  return l->weights[0] * (c->body * s->y.angle - s->lagged) + l->weights[1] * h * rate0 +
         l->weights[2] * (3 * change - h * (2 * rate0 + rate1)) +
         l->weights[3] * (h * (rate0 + rate1) - 2 * change);
}

// Derivative of a power of x >= 0 by x.
INLINE Lane steepness(Lane power, Lane x, Lane exponent) {
  return choose(x > 0, exponent * power / x, (Lane){0});
}

// ln(x/reference); 0 where x is 0.
INLINE Lane log_of(Lane x, double reference) {
  const Mask above = x > 0;
  return choose(above, logarithm(choose(above, x, (Lane){0} + 1) / reference), (Lane){0});
}

// The derivative of the friction's level by the rate in its own direction, and what belongs to its form.
INLINE Lane rub(const Law* law, int features, Lane slip, Slopes* at) {
  const Friction* f = &law->c->friction;
  const Lane none = {0}, one = none + 1;
  if (!(features & RATE)) {
    at->level = one;
    return none;
  }
  const Lane along = slip * at->rate, size = size_of(along);
  const Factors by = factors_of(f, features, along);
  const Mask slips = (f->moment > 0) & (slip != 0), saturates = f->saturation > 0, peaks = f->peak_rate > 0;
  const Lane saturation = choose(saturates, f->saturation, one), peak_rate = choose(peaks, f->peak_rate, one);
  const Lane steepness = choose(saturates, (1 - by.turn * by.turn) / saturation, none);
  const Lane falling = -2 * f->peak * by.shape * along / (peak_rate * peak_rate);
  const Mask moves = (f->exponent != 0) & (size > 0);
  const Lane by_power = choose(moves, f->exponent * by.power / choose(moves, along, one), none);
  const Lane level = choose(slips, f->moment, none), per = -slip * level * law->inverse;
  at->level = choose(f->moment > 0, by.power * by.turn * by.peak, one);
  at->by_friction[0] = per * by.power * by.turn * by.peak * log_of(size, VWT_RATE_REFERENCE);
  at->by_friction[1] = -per * by.power * steepness * along / saturation * by.peak;
  at->by_friction[2] = -per * by.power * by.turn * falling * along / peak_rate;
  at->by_friction[3] = per * by.power * by.turn * by.shape;
  return level * (by_power * by.turn * by.peak + by.power * (steepness * by.peak + by.turn * falling));
}

// The wind's speed at a stage, and the derivative of the acceleration by it.
INLINE void blow(const Law* law, Slopes* at) {
  const Runs* c = law->c;
  at->speed = at->pressure = (Lane){0} + 1;
  at->by_speed = (Lane){0};
  for (int k = 0; k < VWT_LANES; k++) {
    if (!is_sampled(c, k)) {
      continue;
    }
    const double wind = wind_at(c->run[k], at->time[k]);
    const double moment = at->seen[k] * (1 + c->law.moment_cubic[k] * at->powers.steepening[k]) + c->law.flow_angle[k];
    const double loss = (1 + c->law.damping_quadratic[k] * at->powers.thickening[k]) * c->body[k] * at->rate[k];
    const double flow = flow_of(c->law.p[k]), length = c->law.p[k]->reference_length;
    at->speed[k] = wind;
    at->pressure[k] = wind * wind;
    at->by_speed[k] = wind > 0 ? law->inverse[k] * c->body[k] * flow *
                                     (2 * wind * c->law.p[k]->cn_beta * moment + length * c->law.p[k]->cn_r * loss)
                               : 0;
  }
}

// The slope at a stage, and the derivatives of the acceleration by the motion there.
INLINE Motion evaluate(const Law* law, Lane slip, int features, const Instant* now, const Motion* y, Lane lagged,
                       Slopes* at) {
  const Runs* c = law->c;
  const Lane none = {0}, angle = y->angle, rate = y->rate, body = c->body * angle, size = size_of(body);
  const Lane deflection = deflection_at(c, features, angle, now->input), bend = size_of(deflection);
  const Air air = now->air;
  at->angle = angle;
  at->rate = rate;
  at->time = now->time;
  at->input = now->input;
  at->deflection = deflection;
  at->seen = seen_at(&c->wake, features, body, lagged);
  at->air = air;
  const Motion found = slope_at(c, features, now, y, lagged, slip, &at->powers);
  const Powers* p = &at->powers;
  Lane steepening = 2 * size, thickening = steepening, turning_rate = 2 * size_of(rate), cube = 3 * p->square,
       square = 2 * bend;
  if (features & STEEPENING) {
    steepening = steepness(p->steepening, size, law->steepening);
  }
  if (features & THICKENING) {
    thickening = steepness(p->thickening, size, law->thickening);
  }
  if (features & RATE_POWER) {
    turning_rate = steepness(p->rate, size_of(rate), law->rate);
  }
  if (features & (CUBE | SQUARE)) {
    cube = steepness(p->cube, bend, law->cube);
    square = steepness(p->square, bend, law->square);
  }
  const Lane leads = choose(c->wake.lag < 0, 2 * c->body, c->body);
  const Lane seen_by_angle = features & LAG ? choose(c->wake.lag > 0, none, leads) : c->body;
  if (features & WIND) {
    blow(law, at);
  }
  const Lane steep = air.stiffness * (1 + c->law.moment_cubic * p->steepening);
  Lane by_angle = c->body * (steep * seen_by_angle +
                             air.stiffness * at->seen * c->law.moment_cubic * with_sign(steepening, body) * c->body +
                             air.damping * c->law.damping_quadratic * with_sign(thickening, body) * c->body *
                                 (c->body * rate));
  const Lane by_bend = c->law.cubic * cube + c->law.quadratic * with_sign(square, deflection);
  by_angle -= by_bend + c->rod;
  if (features & DRIVE) {
    const Lane played = choose(bend < c->law.free_play, c->law.spring, none);
    at->by_input = (c->scale + c->turns * (by_bend - played)) * law->inverse;
  }
  by_angle -= choose(bend < c->law.free_play, none, c->law.spring);
  if (features & GRAVITY) {
    by_angle -= c->law.gravity * cosine(angle - c->law.gravity_angle);
  }
  Lane by_rate = c->body * air.damping * (1 + c->law.damping_quadratic * p->thickening) * c->body;
  by_rate -= c->law.quadratic_damping * turning_rate + c->law.loss + c->damping + slip * slip * rub(law, features, slip, at);
  at->by_angle = by_angle * law->inverse;
  at->by_rate = by_rate * law->inverse;
  if (features & LAG) {
    const Lane side = choose(c->wake.lag > 0, none + 1, choose(c->wake.lag < 0, none - 1, none));
    at->by_lagged = side * c->body * steep * law->inverse;
  }
  return found;
}

// The derivative of the acceleration at a stage along a change of the samples of its wind or its drive.
INLINE Lane by_samples(const Law* law, int change, const Input* in, const Slopes* at) {
  Lane out = {0};
  for (int k = 0; k < VWT_LANES; k++) {
    const vwt_run* run = law->c->run[k];
    const int winds = (int)run->wind_count, drives = (int)run->moment_count;
    if (is_sampled(law->c, k)) {
      out[k] = at->by_speed[k] * vwt_series(law->changes[k] + (long)change * winds, winds, run->wind_interval, at->time[k]);
    } else if (drives > 0) {
      const double* row = law->changes[k] + (long)change * 2 * drives + in->sample[k];
      out[k] = at->by_input[k] * (row[0] + in->begun[k] * row[drives] * (at->time[k] - in->from[k]));
    }
  }
  return out;
}

// The derivative of the acceleration at a stage by a term, `features` those of the law.
INLINE Lane by_term(const Law* law, int features, int term, Lane slip, const Input* in, const Slopes* at) {
  const Runs* c = law->c;
  const Lane none = {0}, angle = at->angle, rate = at->rate, bend = at->deflection;
  const Powers* p = &at->powers;
  const Wake* wake = &c->wake;
  const Lane speed = features & WIND ? at->speed : none + 1, pressure = features & WIND ? at->pressure : none + 1;
  if (term >= VWT_TERM_COUNT) {
    return by_samples(law, term - VWT_TERM_COUNT, in, at);
  }
  switch (term) {
    case VWT_TERM_angle:
      return -angle;
    case VWT_TERM_rate:
      return -rate;
    case VWT_TERM_seen:
      return at->seen * law->seen * pressure;
    case VWT_TERM_air_rate:
      return rate * speed;
    case VWT_TERM_steepening:
      return at->seen * p->steepening * law->steep * pressure;
    case VWT_TERM_thickening:
      return rate * p->thickening * law->thick * speed;
    case VWT_TERM_rate_power:
      return -with_sign(p->rate, rate);
    case VWT_TERM_cube:
      return -with_sign(p->cube, bend);
    case VWT_TERM_square:
      return -p->square;
    case VWT_TERM_play:
      return taken_up(&c->law, bend);
    case VWT_TERM_constant:
      return pressure;
    case VWT_TERM_drive:
      return at->input;
    case VWT_TERM_gravity_sine:
      return -sine(angle);
    case VWT_TERM_gravity_cosine:
      return cosine(angle);
    case VWT_TERM_friction:
      return -slip * at->level;
    case VWT_TERM_shedding_sine:
      return sine(wake->turn * at->time);
    case VWT_TERM_shedding_cosine:
      return cosine(wake->turn * at->time);
    case VWT_TERM_steepening_exponent:
      return law->inverse * c->body * at->air.stiffness * c->law.moment_cubic * at->seen * p->steepening *
             log_of(size_of(angle), VWT_ANGLE_REFERENCE);
    case VWT_TERM_thickening_exponent:
      return law->inverse * c->body * c->body * at->air.damping * c->law.damping_quadratic * rate * p->thickening *
             log_of(size_of(angle), VWT_ANGLE_REFERENCE);
    case VWT_TERM_rate_exponent:
      return -law->inverse * c->law.quadratic_damping * with_sign(p->rate, rate) *
             log_of(size_of(rate), VWT_RATE_REFERENCE);
    case VWT_TERM_cube_exponent:
      return -law->inverse * c->law.cubic * with_sign(p->cube, bend) * log_of(size_of(bend), VWT_ANGLE_REFERENCE);
    case VWT_TERM_square_exponent:
      return -law->inverse * c->law.quadratic * p->square * log_of(size_of(bend), VWT_ANGLE_REFERENCE);
    case VWT_TERM_gap:
      return choose(size_of(bend) > c->law.free_play, with_sign(law->inverse * c->law.spring, bend), none);
    case VWT_TERM_friction_exponent:
      return features & RATE
                 ? at->by_friction[0]
                 : -slip * law->inverse * c->friction.moment * log_of(size_of(rate), VWT_RATE_REFERENCE);
    case VWT_TERM_friction_saturation:
      return features & RATE ? at->by_friction[1] : none;
    case VWT_TERM_friction_peak_rate:
      return features & RATE ? at->by_friction[2] : none;
    case VWT_TERM_friction_peak:
      return features & RATE ? at->by_friction[3] : none;
    case VWT_TERM_lag:
      return at->by_lag;
    case VWT_TERM_turn:
      return law->inverse * c->body * wake->shedding * at->time * cosine(wake->turn * at->time + c->law.phase);
    default:  // of the start
      return none;
  }
}

// The values of the terms of one lane.
static void set_terms(const Law* law, int k, const vwt_run* run, double* out) {
  const Runs* c = law->c;
  const vwt_parameters* p = c->law.p[k];
  const int lags = c->wake.lag[k] != 0, sampled = is_sampled(c, k);
  const double inverse = law->inverse[k], body = c->body[k], flow = flow_of(p);
  const double air = body * (sampled ? flow * p->cn_beta : c->air.stiffness[k]) * inverse;
  const double air_rate = body * body * (sampled ? flow * p->reference_length * p->cn_r : c->air.damping[k]) * inverse;
  out[VWT_TERM_angle] = (c->law.spring[k] + c->rod[k]) * inverse - (lags || sampled ? 0 : air * body);
  out[VWT_TERM_rate] = (c->damping[k] + c->law.loss[k]) * inverse - (sampled ? 0 : air_rate);
  out[VWT_TERM_seen] = lags || sampled ? air * body : 0;
  out[VWT_TERM_air_rate] = sampled ? air_rate : 0;
  out[VWT_TERM_steepening] = air * c->law.moment_cubic[k] / law->steep[k];
  out[VWT_TERM_thickening] = air_rate * c->law.damping_quadratic[k] / law->thick[k];
  out[VWT_TERM_rate_power] = c->law.quadratic_damping[k] * inverse;
  out[VWT_TERM_cube] = c->law.cubic[k] * inverse;
  out[VWT_TERM_square] = c->law.quadratic[k] * inverse;
  out[VWT_TERM_play] = c->law.free_play[k] > 0 ? c->law.spring[k] * inverse : 0;
  out[VWT_TERM_constant] = air * c->law.flow_angle[k] + c->offset[k] * inverse;
  out[VWT_TERM_drive] = c->scale[k] * inverse;
  out[VWT_TERM_gravity_sine] = c->law.gravity[k] * inverse * cos(c->law.gravity_angle[k]);
  out[VWT_TERM_gravity_cosine] = c->law.gravity[k] * inverse * sin(c->law.gravity_angle[k]);
  out[VWT_TERM_friction] = c->friction.moment[k] * inverse;
  out[VWT_TERM_shedding_sine] = body * c->wake.shedding[k] * inverse * cos(c->law.phase[k]);
  out[VWT_TERM_shedding_cosine] = body * c->wake.shedding[k] * inverse * sin(c->law.phase[k]);
  out[VWT_TERM_steepening_exponent] = law->steepening[k];
  out[VWT_TERM_thickening_exponent] = law->thickening[k];
  out[VWT_TERM_rate_exponent] = law->rate[k];
  out[VWT_TERM_cube_exponent] = law->cube[k];
  out[VWT_TERM_square_exponent] = law->square[k];
  out[VWT_TERM_gap] = c->law.free_play[k];
  out[VWT_TERM_friction_exponent] = p->friction_exponent;
  out[VWT_TERM_friction_saturation] = c->friction.saturation[k];
  out[VWT_TERM_friction_peak_rate] = c->friction.peak_rate[k];
  out[VWT_TERM_friction_peak] = p->friction_peak;
  out[VWT_TERM_friction_load] = p->friction_load;
  out[VWT_TERM_lag] = c->wake.lag[k];
  out[VWT_TERM_turn] = c->wake.turn[k];
  out[VWT_TERM_pace] = log(run->step);
  out[VWT_TERM_start_angle] = run->angle;
  out[VWT_TERM_start_rate] = run->rate;
  out[VWT_TERM_start_lagged] = lags ? run->lagged / body : 0;
}

#endif  // VWT_STAGES_H_
