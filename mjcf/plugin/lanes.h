// Runs in several lanes at once, which lanes.c and slopes.c share. Their law is that of one run (law.h), and every
// operation is that of forward.c in the same order.

#ifndef VWT_LANES_H_
#define VWT_LANES_H_

#include <math.h>

#include "moment.h"
#include "plain.h"
#include "step.h"

#define LAW_LANES VWT_LANES
#include "law.h"

// Compiled for wide registers too, among which the loader chooses: no operation is fused, so the bits are the same.
#if VWT_WIDE
#define CLONED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLONED
#endif

// The runs, by lane.
typedef struct {
  Coefficients law;
  Air air;    // in a constant wind
  int rubs;   // whether any lane has Coulomb friction
  Mask dry;   // the lanes that have
  int count;  // of the lanes that are runs; the others repeat the first one's start
  const vwt_run* run[VWT_LANES];
  Lane step, whole_step, half_step, body, inertia, damping, rod;
  Lane twist_stiffness, twist_damping, lower;  // of a rod that twists, and the inertia below it; above it: `inertia`
  Friction friction;
  Lane range;  // of Dahl's friction, rad
  Lane scale, offset, turns;  // of a drive: N m per unit and N m, seen from the upper end; 1 where it turns the root
  Mask on_end;                // the lanes whose drive acts on the upper end
  double half[VWT_LANES][4], whole[VWT_LANES][4];  // weights of the lag
} Lanes;

// The input of a drive in a step, by lane: its value at a time, s, and its slope from there on; 0 without a drive.
typedef struct {
  Lane value, slope, from, begun;  // 1 from the first sample on
  int sample[VWT_LANES];
} Input;

// The start of a step, by lane.
typedef struct {
  Lane start, angle, rate, twist, twist_rate, lagged, slip, deflection;
  int rests[VWT_LANES];
} State;

static int twists(const vwt_run* run) { return run->twist_stiffness > 0; }
static int bends(const vwt_parameters* p) { return p->presliding > 0; }

static void set_lane(Lanes* c, int k, const vwt_parameters* p, const vwt_run* run) {
  const double wind = fmax(0, run->wind[0]);
  const int stride = run->stride > 1 && run->steps == 1 ? (int)run->stride : 1;
  set_coefficients(&c->law, k, p);
  set_wake(&c->law, k, p, wind);
  set_air(&c->air, k, p, wind);
  c->law.features |= features_of(p, wind) | (run->wind_count > 1 ? WIND : 0) | (run->moment_count > 0 ? DRIVE : 0) |
                     (twists(run) ? TWIST : 0) | (bends(p) ? DAHL : 0) | (run->program_count > 0 ? PROGRAM : 0);
  c->rubs |= vwt_rubs(p) && !bends(p);
  c->dry[k] = -(vwt_rubs(p) && !bends(p));
  c->range[k] = bends(p) ? vwt_presliding_range(p, p->yaw_inertia, run->step) : 1;
  c->run[k] = run;
  c->step[k] = run->step;
  c->whole_step[k] = stride * run->step;
  c->half_step[k] = c->whole_step[k] / 2;
  c->body[k] = 1 + run->lead;
  c->rod[k] = run->rod_stiffness;
  const double upper = (twists(run) ? run->inertia_share : 1) * p->yaw_inertia;
  c->inertia[k] = upper;
  c->lower[k] = (1 - run->inertia_share) * p->yaw_inertia;
  c->twist_stiffness[k] = run->twist_stiffness;
  c->twist_damping[k] = run->twist_damping;
  c->damping[k] = p->mechanical_damping;
  set_friction(&c->friction, k, p, vwt_friction_least_rate(p, upper, run->step));
  if (run->moment_count > 0) {
    const double share = run->moment_on_end != 0 ? 1 : c->body[k];
    c->scale[k] = share * run->moment_scale;
    c->offset[k] = share * run->moment_offset;
    c->on_end[k] = -(run->moment_on_end != 0);
    c->turns[k] = run->moment_on_end != 0 && p->spring_stiffness > 0;
  }
  const double lag = fabs(c->law.lag[k]);
  if (lag != 0) {
    vwt_lag_weights(c->half_step[k] / lag, c->half[k]);
    vwt_lag_weights(c->whole_step[k] / lag, c->whole[k]);
  }
}

INLINE long long any(Mask where) {
  long long out = 0;
  for (int k = 0; k < VWT_LANES; k++) {
    out |= where[k];
  }
  return out;
}

// Of the longest run; the others are followed beyond their ends.
static inline int most_samples(const Lanes* c) {
  double most = 0;
  for (int k = 0; k < c->count; k++) {
    most = fmax(most, c->run[k]->samples);
  }
  return (int)most;
}

// The air at a time.
INLINE Air air_at(const Lanes* c, int features, Lane time) {
  Air out = c->air;
  for (int k = 0; features & WIND && k < VWT_LANES; k++) {
    const vwt_run* run = c->run[k];
    if (run->wind_count > 1) {
      const double wind = fmax(0, vwt_series(run->wind, (int)run->wind_count, run->wind_interval, time[k]));
      set_air(&out, k, c->law.p[k], wind);
    }
  }
  return out;
}

// The input in a step from `start` on, whose middle is half a step later.
INLINE Input input_of(const Lanes* c, int features, Lane start, Lane half) {
  Input out = {.value = {0}};
  for (int k = 0; features & DRIVE && k < VWT_LANES; k++) {
    const vwt_run* run = c->run[k];
    const int last = (int)run->moment_count - 1;
    if (last < 0) {
      continue;
    }
    const double first = run->moment_time[0] + run->moment_delay;
    const double passed = floor((start[k] + half[k] - first) / run->moment_interval);
    const int at = passed < 0 ? 0 : passed < last ? (int)passed : last;
    out.sample[k] = at;
    out.value[k] = run->moment[at];
    out.from[k] = first + at * run->moment_interval;
    out.begun[k] = passed >= 0;
    out.slope[k] = passed >= 0 ? run->moment_slope[at] : 0;
  }
  return out;
}

INLINE Lane input_at(const Input* in, int features, Lane time) {
  return features & DRIVE ? in->value + in->slope * (time - in->from) : in->value;
}

// The angle by which the spring is deflected.
INLINE Lane deflection_at(const Lanes* c, int features, Lane angle, Lane input) {
  return features & DRIVE ? angle - c->turns * input : angle;
}

// Per unit of the slip, which is that of Dahl's deflection over its range where friction is his.
INLINE Lane friction_at(const Lanes* c, int features, Lane slip, Lane angle, Lane rate) {
  if (!(features & RATE)) {
    return c->friction.moment;
  }
  Lane load = {0};
  for (int k = 0; features & LOAD && k < VWT_LANES; k++) {
    load[k] = vwt_load(c->law.p[k], angle[k], 0);
  }
  return friction_level(&c->friction, features, features & DAHL ? size_of(rate) : slip * rate, load);
}

// The moment by expression, N m.
void vwt_program_lanes(const Lanes* c, const Lane* time, const Lane* angle, const Lane* rate, Lane* value);

INLINE Lane with_stated(const Lanes* c, int features, Lane moment, Lane time, Lane angle, Lane rate) {
  Lane stated;
  if (!(features & PROGRAM)) {
    return moment;
  }
  vwt_program_lanes(c, &time, &angle, &rate, &stated);
  return moment + stated;
}

// Angular acceleration at a motion, with the powers in it; `shed`, `lagged` and `input` are read only with the features
// they belong to.
INLINE Lane acceleration(const Lanes* c, const Air* flow, Lane slip, int features, Lane time, Lane angle, Lane rate,
                         Lane shed, Lane lagged, Lane input, Powers* powers) {
  const Coefficients* law = &c->law;
  const Lane air = moment_of_air(law, flow, features, c->body * angle, c->body * rate, shed, lagged, powers);
  const Lane deflection = deflection_at(c, features, angle, input);
  Lane moment = moment_of_mechanism(law, features, angle, deflection, rate, powers);
  moment = with_stated(c, features, moment, time, angle, rate);
  moment = moment - law->spring * angle - c->damping * rate;
  moment = moment + c->body * air - c->rod * angle;
  if (features & DRIVE) {
    moment = moment + (c->scale * input + c->offset);
  }
  return (moment - slip * friction_at(c, features, slip, angle, rate)) / c->inertia;
}

INLINE Lane acceleration_at(const Lanes* c, const Air* flow, Lane slip, int features, Lane time, Lane angle, Lane rate,
                            Lane shed, Lane lagged, Lane input) {
  Powers powers;
  return acceleration(c, flow, slip, features, time, angle, rate, shed, lagged, input, &powers);
}

INLINE Lane lagged_at(const Lanes* c, const State* s, const double weights[][4], Lane duration,
                             Lane angle, Lane rate) {
  const Lane angle0 = c->body * s->angle, rate0 = c->body * s->rate, angle1 = c->body * angle, rate1 = c->body * rate;
  Lane out = {0};
  for (int k = 0; k < VWT_LANES; k++) {
    if (c->law.lag[k] != 0) {
      out[k] = vwt_lag_weighted(weights[k], s->lagged[k], duration[k], angle0[k], rate0[k], angle1[k], rate1[k]);
    }
  }
  return out;
}

INLINE Lane slid(const Lanes* c, Lane deflection, Lane side, Lane distance) {
  const Lane end = side * c->range, moved = end + (deflection - end) * exponential(-distance / c->range);
  return choose(distance > 0, moved, deflection);
}

// Dahl's deflection, as vwt_presliding_advance.
INLINE Lane deflection_after(const Lanes* c, const State* s, Lane duration, Lane angle, Lane rate) {
  const Lane none = {0}, one = none + 1, change = angle - s->angle;
  const Mask forwards = (s->rate > 0) | ((s->rate == 0) & (change > 0)), reverses = s->rate * rate < 0;
  const Lane side = choose(forwards, one, -one), apart = choose(reverses, size_of(rate - s->rate), one);
  const Lane back = choose(reverses, duration * rate * rate / (2 * apart), none);
  return slid(c, slid(c, s->deflection, side, side * change + back), -side, back);
}

// The lanes that have Coulomb friction and do not slide on throughout a step: the others have moved as the step says.
INLINE Mask turning(const Lanes* c, const State* before, Lane rate) {
  const Mask slides = (before->rate != 0) & (rate * before->slip > 0);
  return c->dry & ~slides;
}

// A step of one lane that reverses or sticks under Coulomb friction. Where it changes nothing in a steady law, the lane
// rests for good.
static inline void step_alone(const Lanes* c, State* s, int k, Step* alone) {
  const double angle = s->angle[k], rate = s->rate[k], lagged = s->lagged[k];
  const int steady = c->law.shedding[k] == 0 && alone->run->moment_count == 0 && alone->run->program_count == 0 &&
                     !twists(alone->run);
  alone->start = s->start[k];
  alone->from.angle = s->angle[k];
  alone->from.rate = s->rate[k];
  alone->from.twist = s->twist[k];
  alone->from.twist_rate = s->twist_rate[k];
  alone->lagged = s->lagged[k];
  alone->slip = (int)s->slip[k];
  if (alone->run->moment_count > 0) {
    vwt_set_drive(alone);
  }
  vwt_step_with_friction(alone, c->whole_step[k]);
  s->angle[k] = alone->from.angle;
  s->rate[k] = alone->from.rate;
  s->twist[k] = alone->from.twist;
  s->twist_rate[k] = alone->from.twist_rate;
  s->lagged[k] = alone->lagged;
  s->slip[k] = alone->slip;
  const int changed = s->rate[k] != 0 || rate != 0 || s->angle[k] != angle || s->lagged[k] != lagged;
  s->rests[k] = !changed && steady;
}

// Up to `VWT_LANES` runs at their start.
static inline void release(int count, const vwt_parameters* parameters, const vwt_run* runs, Lanes* c, State* s,
                    Step* alone, LagWeights* weights) {
  for (int k = 0; k < VWT_LANES; k++) {
    const int i = k < count ? k : 0;  // a lane too many repeats the first run
    set_lane(c, k, &parameters[i], &runs[i]);
    alone[k] = vwt_release(&parameters[i], &runs[i], &weights[k]);
    s->start[k] = 0;
    s->angle[k] = alone[k].from.angle;
    s->rate[k] = alone[k].from.rate;
    s->twist[k] = alone[k].from.twist;
    s->twist_rate[k] = alone[k].from.twist_rate;
    s->lagged[k] = alone[k].lagged;
    s->slip[k] = c->dry[k] ? alone[k].slip : 0;
    s->deflection[k] = 0;
  }
}

#endif  // VWT_LANES_H_
