// Plain runs integrated side by side, which keeps a processor's arithmetic units busy: the steps of one run wait for
// each other, those of several do not. Every operation is that of forward.c in the same order, so that
// a run has the same bits in any company, and as an only run of forward.c.

#include <math.h>

#include "expression.h"
#include "lanes.h"

// Whether the root of a spring moves as far as the input says, where it moves.
static int is_plain_drive(const vwt_parameters* p, const vwt_run* run) {
  const int turned = run->moment_on_end == 0 || (run->moment_scale == p->spring_stiffness && run->moment_offset == 0);
  return run->moment_slope && run->wind_count == 1 && p->friction_load == 0 && turned;
}

static vwt_program program_of(const vwt_run* run) {
  const vwt_program program = {run->program, (int)run->program_count};
  return program;
}

static int is_sound(const vwt_run* run) {
  const vwt_program program = program_of(run);
  return vwt_program_sound(&program);
}

int vwt_is_plain(const vwt_parameters* p, const vwt_run* run) {
  const int steady = run->wind_count == 1 || (p->aero_lag == 0 && p->shedding_amplitude == 0);
  return steady && run->forcing_count == 0 && run->ambient_count == 0 &&
         (run->moment_count == 0 || is_plain_drive(p, run)) &&
         (run->program_count == 0 || is_sound(run)) &&
         (twists(run) ? p->aero_lag == 0 && run->lead == 0 && run->rod_stiffness == 0 && !bends(p)
                      : run->twist == 0 && run->twist_rate == 0);
}

int vwt_alike(const vwt_parameters* p, const vwt_run* one, const vwt_parameters* q, const vwt_run* other) {
  const vwt_program program = program_of(one), beside = program_of(other);
  return one->steps == other->steps && one->stride == other->stride && twists(one) == twists(other) &&
         bends(p) == bends(q) && vwt_programs_alike(&program, &beside);
}

// The motion after a step.
INLINE void runge_kutta(const Lanes* c, const State* s, int features, Lane* angle, Lane* rate) {
  const Lane h = c->whole_step, half = c->half_step, none = {0};
  const int sheds = features & SHEDDING, lags = features & LAG, bent = features & DAHL;
  const Input in = input_of(c, features, s->start, half);
  Lane shed = sheds ? shed_at(&c->law, s->start) : none;
  Air air = air_at(c, features, s->start);
  Lane input = input_at(&in, features, s->start);
  Lane slip = bent ? s->deflection / c->range : s->slip;
  const Lane a1 = acceleration_at(c, &air, slip, features, s->start, s->angle, s->rate, shed, s->lagged, input);
  const Lane y2 = s->angle + half * s->rate, r2 = s->rate + half * a1;
  shed = sheds ? shed_at(&c->law, s->start + half) : none;
  air = air_at(c, features, s->start + half);
  input = input_at(&in, features, s->start + half);
  Lane lagged = lags ? lagged_at(c, s, c->half, half, y2, r2) : none;
  slip = bent ? deflection_after(c, s, half, y2, r2) / c->range : s->slip;
  const Lane a2 = acceleration_at(c, &air, slip, features, s->start + half, y2, r2, shed, lagged, input);
  const Lane y3 = s->angle + half * r2, r3 = s->rate + half * a2;
  lagged = lags ? lagged_at(c, s, c->half, half, y3, r3) : none;
  slip = bent ? deflection_after(c, s, half, y3, r3) / c->range : s->slip;
  const Lane a3 = acceleration_at(c, &air, slip, features, s->start + half, y3, r3, shed, lagged, input);
  const Lane y4 = s->angle + h * r3, r4 = s->rate + h * a3;
  shed = sheds ? shed_at(&c->law, s->start + h) : none;
  air = air_at(c, features, s->start + h);
  input = input_at(&in, features, s->start + h);
  lagged = lags ? lagged_at(c, s, c->whole, h, y4, r4) : none;
  slip = bent ? deflection_after(c, s, h, y4, r4) / c->range : s->slip;
  const Lane a4 = acceleration_at(c, &air, slip, features, s->start + h, y4, r4, shed, lagged, input);
  *angle = s->angle + h * ((s->rate + 2 * (r2 + r3) + r4) / 6);
  *rate = s->rate + h * ((a1 + 2 * (a2 + a3) + a4) / 6);
}

// The derivatives of the rates of the rod's upper end and of its twist.
typedef struct {
  Lane rate, twist_rate;
} Accelerations;

INLINE Accelerations twisting(const Lanes* c, const State* s, const Input* in, int features, Lane time, Lane angle,
                              Lane rate, Lane twist, Lane twist_rate) {
  Powers powers;
  const Coefficients* law = &c->law;
  const Lane none = {0}, shed = features & SHEDDING ? shed_at(law, time) : none;
  const Air flow = air_at(c, features, time);
  Lane air = moment_of_air(law, &flow, features, angle + twist, rate + twist_rate, shed, none, &powers);
  Lane deflection = angle, moment = none;
  if (features & DRIVE) {
    const Lane input = input_at(in, features, time), drive = c->scale * input + c->offset;
    deflection = deflection_at(c, features, angle, input);
    air = air + choose(c->on_end, none, drive);
    moment = choose(c->on_end, drive, none);
  }
  const Lane mechanism = moment_of_mechanism(law, features, angle, deflection, rate, &powers);
  moment = with_stated(c, features, mechanism, time, angle, rate) + moment;
  moment = moment - law->spring * angle - c->damping * rate;
  const Lane spring = c->twist_stiffness * twist, loss = c->twist_damping * twist_rate;
  Accelerations out;
  out.rate = (moment + spring + loss - s->slip * friction_at(c, features, s->slip, angle, rate)) / c->inertia;
  out.twist_rate = (air - (spring + loss)) / c->lower - out.rate;
  return out;
}

// The motion after a step with a rod that twists.
INLINE void runge_kutta_twisting(const Lanes* c, const State* s, int features, State* to) {
  const Lane h = c->whole_step, half = c->half_step, middle = s->start + half;
  const Input in = input_of(c, features, s->start, half);
  const Accelerations a1 = twisting(c, s, &in, features, s->start, s->angle, s->rate, s->twist, s->twist_rate);
  const Lane r2 = s->rate + half * a1.rate, w2 = s->twist_rate + half * a1.twist_rate;
  const Accelerations a2 = twisting(c, s, &in, features, middle, s->angle + half * s->rate, r2,
                                    s->twist + half * s->twist_rate, w2);
  const Lane r3 = s->rate + half * a2.rate, w3 = s->twist_rate + half * a2.twist_rate;
  const Accelerations a3 = twisting(c, s, &in, features, middle, s->angle + half * r2, r3, s->twist + half * w2, w3);
  const Lane r4 = s->rate + h * a3.rate, w4 = s->twist_rate + h * a3.twist_rate;
  const Accelerations a4 = twisting(c, s, &in, features, s->start + h, s->angle + h * r3, r4, s->twist + h * w3, w4);
  to->angle = s->angle + h * ((s->rate + 2 * (r2 + r3) + r4) / 6);
  to->rate = s->rate + h * ((a1.rate + 2 * (a2.rate + a3.rate) + a4.rate) / 6);
  to->twist = s->twist + h * ((s->twist_rate + 2 * (w2 + w3) + w4) / 6);
  to->twist_rate = s->twist_rate + h * ((a1.twist_rate + 2 * (a2.twist_rate + a3.twist_rate) + a4.twist_rate) / 6);
}

INLINE void step(const Lanes* c, State* s, int features, Step* alone) {
  const State before = *s;
  if (features & TWIST) {
    runge_kutta_twisting(c, &before, features, s);
  } else {
    runge_kutta(c, &before, features, &s->angle, &s->rate);
  }
  if (features & LAG) {
    s->lagged = lagged_at(c, &before, c->whole, c->whole_step, s->angle, s->rate);
  }
  if (features & DAHL) {
    s->deflection = deflection_after(c, &before, c->whole_step, s->angle, s->rate);
  }
  if (!c->rubs) {
    return;
  }
  const Mask turns = turning(c, &before, s->rate);
  if (!any(turns)) {
    return;
  }
  for (int k = 0; k < c->count; k++) {
    if (turns[k]) {
      s->angle[k] = before.angle[k];
      s->rate[k] = before.rate[k];
      s->twist[k] = before.twist[k];
      s->twist_rate[k] = before.twist_rate[k];
      s->lagged[k] = before.lagged[k];
      if (!before.rests[k]) {
        step_alone(c, s, k, &alone[k]);
      }
    }
  }
}

// Samples within a step, as vwt_fill.
INLINE void fill(const Lanes* c, const State* from, const State* to, int stride, int at, double* const* angle,
                 double* const* rate) {
  const Lane h = c->whole_step, change = to->angle - from->angle;
  const Lane c1 = h * from->rate;
  const Lane c2 = 3 * change - h * (2 * from->rate + to->rate);
  const Lane c3 = h * (from->rate + to->rate) - 2 * change;
  for (int j = 1; j < stride; j++) {
    const double u = j / (double)stride;
    const Lane angles = from->angle + u * (c1 + u * (c2 + u * c3));
    const Lane rates = (c1 + u * (2 * c2 + u * 3 * c3)) / h;
    for (int k = 0; k < c->count; k++) {
      if (at + j < c->run[k]->samples) {
        angle[k][at + j] = angles[k];
        rate[k][at + j] = rates[k];
      }
    }
  }
}

INLINE int integrate(const Lanes* c, State* s, int features, int count, Step* alone,
                            const vwt_run* like, double* const* angle, double* const* rate) {
  const int samples = most_samples(c), steps = (int)like->steps;
  const int stride = like->stride > 1 && steps == 1 ? (int)like->stride : 1;
  int failed = VWT_LANES;  // the first lane whose motion grew without bound
  for (int i = 0; i < samples; i += stride) {
    const State before = *s;
    for (int k = 0; k < count; k++) {
      if (i < c->run[k]->samples) {
        angle[k][i] = before.angle[k];
        rate[k][i] = before.rate[k];
      }
    }
    for (int j = 0; j < steps; j++) {
      step(c, s, features, alone);
      s->start = (i * (double)steps + stride * (j + 1)) * c->step;  // no drift of the clock
    }
    if (stride > 1) {
      fill(c, &before, s, stride, i, angle, rate);
    }
    if (any(~(size_of(s->angle) < 1e6))) {
      for (int k = count - 1; k >= 0; k--) {
        failed = !(fabs(s->angle[k]) < 1e6) && i < c->run[k]->samples && k < failed ? k : failed;
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
  Lanes c = {.count = count};
  State s = {.rests = {0}};
  LagWeights weights[VWT_LANES] = {{{0}, {{0}}, 0}};
  Step alone[VWT_LANES];
  release(count, parameters, runs, &c, &s, alone, weights);
  // compiled apart: rods that twist, and the law of most runs, which has none of the features
  if (c.law.features & TWIST) {
    return integrate(&c, &s, c.law.features | TWIST, count, alone, runs, angle, rate);
  }
  return c.law.features == 0 ? integrate(&c, &s, 0, count, alone, runs, angle, rate)
                             : integrate(&c, &s, c.law.features & ~TWIST, count, alone, runs, angle, rate);
}
