// Runs and their motion in a step of the Runge-Kutta method, written once for every width, as their law is (law.h).
// Every operation is the same at every width, in the same order, so that a run has the same bits in any company. What
// one width alone has is in functions that say so.

#ifndef VWT_MOTION_H_
#define VWT_MOTION_H_

#include <math.h>

#include "expression.h"
#include "law.h"
#include "moment.h"
#include "run.h"

// The runs, by lane.
typedef struct {
  Coefficients law;
  Air air;    // in a constant wind
  Wake wake;  // side by side: always in a constant wind
  int rubs;   // whether any lane has Coulomb friction
  Mask dry;   // the lanes that have
  int count;  // of the lanes that are runs; the others repeat the first one's start
  const vwt_run* run[WIDTH];
  Lane step, whole_step, half_step, body, inertia, damping, rod;
  Lane twist_stiffness, twist_damping, lower;  // of a rod that twists, and the inertia below it; above it: `inertia`
  Friction friction;
  Lane range;                 // of Dahl's friction, rad
  Lane scale, offset, turns;  // of a drive: N m per unit and N m; 1 where it turns the root
  Mask on_end;                // the lanes whose drive acts on the upper end
  vwt_lag half[WIDTH], whole[WIDTH];  // over the durations that a step uses
} Runs;

// Angle and rate of the rod's upper end and of its twist; also the derivatives of these by time.
typedef struct {
  Lane angle, rate, twist, twist_rate;
} Motion;

// The start of a step; slip: the sign of the rate under Coulomb friction, 0 at rest; deflection: Dahl's.
typedef struct {
  Lane start;
  Motion y;
  Lane lagged, slip, deflection;
} State;

// The input of a drive in a step: its value at a time, s, and its slope from there on; 0 without a drive.
typedef struct {
  Lane value, slope, from, begun;  // 1 from the first sample on
  int sample[WIDTH];
} Input;

// What acts at a time, whatever the motion.
typedef struct {
  Lane time, input, shed, forcing, ambient;  // the last three in N m
  Air air;
  Wake wake;
} Instant;

INLINE int twists(const vwt_run* run) { return run->twist_stiffness > 0; }
INLINE int bends(const vwt_parameters* p) { return p->presliding > 0; }
INLINE int strides(const vwt_run* run) { return run->stride > 1 && run->steps == 1 ? (int)run->stride : 1; }

INLINE double wind_at(const vwt_run* run, double time) {
  return fmax(0, vwt_series(run->wind, (int)run->wind_count, run->wind_interval, time));
}

static inline void set_run(Runs* c, int k, const vwt_parameters* p, const vwt_run* run) {
  const double wind = fmax(0, run->wind[0]), upper = (twists(run) ? run->inertia_share : 1) * p->yaw_inertia;
  set_coefficients(&c->law, k, p);
  set_air(&c->air, k, p, wind);
  set_wake(&c->wake, k, p, wind);
  c->law.features |= features_of(p, run->wind_count > 1 ? 1 : wind) | (run->wind_count > 1 ? WIND : 0) |
                     (run->moment_count > 0 ? DRIVE : 0) | (twists(run) ? TWIST : 0) | (bends(p) ? DAHL : 0) |
                     (run->program_count > 0 ? PROGRAM : 0) |
                     (run->forcing_count > 0 || run->ambient_count > 0 ? FORCED : 0);
  c->rubs |= vwt_rubs(p) && !bends(p);
  AT(c->dry, k) = -(vwt_rubs(p) && !bends(p));
  AT(c->range, k) = bends(p) ? vwt_presliding_range(p, upper, run->step) : 1;
  c->run[k] = run;
  AT(c->step, k) = run->step;
  AT(c->whole_step, k) = strides(run) * run->step;
  AT(c->half_step, k) = AT(c->whole_step, k) / 2;
  AT(c->body, k) = 1 + run->lead;
  AT(c->rod, k) = run->rod_stiffness;
  AT(c->inertia, k) = upper;
  AT(c->lower, k) = (1 - run->inertia_share) * p->yaw_inertia;
  AT(c->twist_stiffness, k) = run->twist_stiffness;
  AT(c->twist_damping, k) = run->twist_damping;
  AT(c->damping, k) = p->mechanical_damping;
  set_friction(&c->friction, k, p, vwt_friction_least_rate(p, upper, run->step));
  if (run->moment_count > 0) {
    const double share = run->moment_on_end != 0 ? 1 : AT(c->body, k);
    AT(c->scale, k) = WIDTH == 1 ? 1 : share * run->moment_scale;  // one run: its input is in N m
    AT(c->offset, k) = WIDTH == 1 ? 0 : share * run->moment_offset;
    AT(c->on_end, k) = -(run->moment_on_end != 0);
    AT(c->turns, k) = run->moment_on_end != 0 && p->spring_stiffness > 0;
  }
  vwt_set_lag(&c->half[k], AT(c->wake.lag, k), AT(c->half_step, k));
  vwt_set_lag(&c->whole[k], AT(c->wake.lag, k), AT(c->whole_step, k));
}

// Runs at their start.
static inline void release(int count, const vwt_parameters* parameters, const vwt_run* runs, Runs* c, State* s) {
  c->count = count;
  for (int k = 0; k < WIDTH; k++) {
    const int i = k < count ? k : 0;  // a lane too many repeats the first run
    const vwt_run* run = &runs[i];
    set_run(c, k, &parameters[i], run);
    AT(s->start, k) = AT(s->deflection, k) = 0;
    AT(s->y.angle, k) = run->angle;
    AT(s->y.rate, k) = run->rate;
    AT(s->y.twist, k) = run->twist;
    AT(s->y.twist_rate, k) = run->twist_rate;
    AT(s->lagged, k) = run->lagged;
    AT(s->slip, k) = !AT(c->dry, k) ? 0 : run->rate > 0 ? 1 : run->rate < 0 ? -1 : 0;
  }
}

// The air at a time.
INLINE Air air_at(const Runs* c, int features, Lane time) {
  Air out = c->air;
  for (int k = 0; features & WIND && k < WIDTH; k++) {
    if (c->run[k]->wind_count > 1) {
      set_air(&out, k, c->law.p[k], wind_at(c->run[k], AT(time, k)));
    }
  }
  return out;
}

// Side by side it is that of a constant wind.
INLINE const Wake* wake_of(const Runs* c, const Instant* now) {
#ifdef LAW_LANES
  (void)now;
  return &c->wake;
#else
  (void)c;
  return &now->wake;
#endif
}

INLINE Instant instant_at(const Runs* c, const Input* in, int features, Lane time) {
  Instant out = {.time = time, .air = air_at(c, features, time), .input = in->value};
  if (WIDTH == 1) {
    set_wake(&out.wake, 0, c->law.p[0], wind_at(c->run[0], AT(time, 0)));
  }
  if (features & DRIVE) {
    out.input = in->value + in->slope * (time - in->from);
  }
  if (features & SHEDDING) {
    out.shed = shed_at(&c->law, wake_of(c, &out), time);
  }
  for (int k = 0; features & FORCED && k < WIDTH; k++) {
    const vwt_run* run = c->run[k];
    const double t = AT(time, k), wind = wind_at(run, t);
    if (run->forcing_count > 0) {
      AT(out.forcing, k) = flow_at(c->law.p[k], wind) * wind *
                           vwt_series(run->forcing, (int)run->forcing_count, run->forcing_interval, t);
    }
    if (run->ambient_count > 0) {
      AT(out.ambient, k) = vwt_series(run->ambient, (int)run->ambient_count, run->ambient_interval, t);
    }
  }
  return out;
}

// The moment of a drive, N m.
INLINE Lane drive_at(const Runs* c, Lane input) { return c->scale * input + c->offset; }

// The angle by which the spring is deflected. A drive turns its root: side by side by the input, and in one run by the
// angle of the moment.
INLINE Lane deflection_at(const Runs* c, int features, Lane angle, Lane input) {
  if (!(features & DRIVE)) {
    return angle;
  }
#ifdef LAW_LANES
  return angle - c->turns * input;
#else
  return c->turns != 0 ? angle - drive_at(c, input) / c->law.spring : angle;
#endif
}

// The moment by expression, N m.
#ifdef LAW_LANES
void vwt_program_lanes(const Runs* c, const Lane* time, const Lane* angle, const Lane* rate, Lane* value);
#endif

INLINE Lane stated_at(const Runs* c, Lane time, Lane angle, Lane rate) {
#ifdef LAW_LANES
  Lane value;
  vwt_program_lanes(c, &time, &angle, &rate, &value);
  return value;
#else
  const vwt_program program = {c->run[0]->program, (int)c->run[0]->program_count};
  const vwt_program_input in = {angle, rate, time, wind_at(c->run[0], time)};
  return vwt_program_value(&program, &in);
#endif
}

// The moment on the rod's upper end except friction, and that on the body, with the powers in them.
INLINE Lane moment_at(const Runs* c, int features, const Instant* now, const Motion* y, Lane lagged, Lane* on_body,
                      Powers* powers) {
  const Coefficients* law = &c->law;
  const int twisted = features & TWIST;
  const int sooner = WIDTH == 1 || twisted;  // the order in which a drive is added
  Lane body = c->body * y->angle, body_rate = c->body * y->rate;
  if (twisted) {
    body += y->twist;
    body_rate += y->twist_rate;
  }
  Lane air = moment_of_air(law, &now->air, wake_of(c, now), features, body, body_rate, now->shed, lagged, powers);
  if (features & FORCED) {
    air += now->forcing;
  }
  if (features & DRIVE && sooner) {
    air += choose(c->on_end, (Lane){0}, drive_at(c, now->input));
  }
  if (features & FORCED) {
    air += now->ambient;
  }
  const Lane deflection = deflection_at(c, features, y->angle, now->input);
  Lane moment = moment_of_mechanism(law, features, y->angle, deflection, y->rate, powers);
  if (features & PROGRAM) {
    moment += stated_at(c, now->time, y->angle, y->rate);
  }
  if (features & DRIVE && sooner) {
    moment += choose(c->on_end, drive_at(c, now->input), (Lane){0});
  }
  moment = moment - law->spring * y->angle - c->damping * y->rate;
  *on_body = air;
  if (twisted) {
    return moment + c->twist_stiffness * y->twist + c->twist_damping * y->twist_rate;
  }
  moment = moment + c->body * air - c->rod * y->angle;
  return features & DRIVE && !sooner ? moment + drive_at(c, now->input) : moment;
}

// At a rate along the slip.
INLINE Lane friction_at(const Runs* c, int features, const Instant* now, Lane angle, Lane along) {
  if (!(features & RATE)) {
    return c->friction.moment;
  }
  Lane load = {0};
  Lane drive = load;
  if (WIDTH == 1 && features & DRIVE) {  // side by side no run has both
    drive = choose(c->on_end, load, drive_at(c, now->input));
  }
  for (int k = 0; features & LOAD && k < WIDTH; k++) {
    AT(load, k) = vwt_load(c->law.p[k], AT(angle, k), AT(drive, k));
  }
  return friction_level(&c->friction, features, along, load);
}

// Of one run that sticks, zero. Side by side, a run that sticks is integrated by itself.
INLINE Lane unless_stuck(const Runs* c, Lane slip, Lane rate) {
#ifdef LAW_LANES
  (void)c, (void)slip;
  return rate;
#else
  return c->dry && slip == 0 ? 0 : rate;
#endif
}

// The derivative of the motion by time. The slip is that of Dahl's deflection over its range where friction is his.
INLINE Motion slope_at(const Runs* c, int features, const Instant* now, const Motion* y, Lane lagged, Lane slip,
                       Powers* powers) {
  Lane air;
  const Lane other = moment_at(c, features, now, y, lagged, &air, powers);
  const Lane level = friction_at(c, features, now, y->angle, features & DAHL ? size_of(y->rate) : slip * y->rate);
  const Lane none = {0}, rate = unless_stuck(c, slip, (other - slip * level) / c->inertia);
  Motion out = {unless_stuck(c, slip, y->rate), rate, none, none};
  if (features & TWIST) {
    const Lane rod = c->twist_stiffness * y->twist + c->twist_damping * y->twist_rate;
    out.twist = y->twist_rate;
    out.twist_rate = (air - rod) / c->lower - rate;
  }
  return out;
}

// The lag's state `duration` after the step's start; the body's angle without a lag.
INLINE Lane lagged_at(const Runs* c, const State* s, int features, const vwt_lag* lag, Lane duration, const Motion* y) {
  Lane angle0 = c->body * s->y.angle, rate0 = c->body * s->y.rate, out = c->body * y->angle, rate1 = c->body * y->rate;
  if (features & TWIST) {
    angle0 += s->y.twist;
    rate0 += s->y.twist_rate;
    out += y->twist;
    rate1 += y->twist_rate;
  }
  for (int k = 0; k < WIDTH; k++) {
    if (lag[k].time != 0) {
      AT(out, k) = vwt_lag_weighted(lag[k].w, AT(s->lagged, k), AT(duration, k), AT(angle0, k), AT(rate0, k),
                                    AT(out, k), AT(rate1, k));
    }
  }
  return out;
}

INLINE Lane bent_at(const Runs* c, const State* s, Lane duration, const Motion* y) {
  return deflection_after(c->range, s->deflection, duration, s->y.angle, s->y.rate, y->angle, y->rate);
}

INLINE Motion along(int features, const Motion* y, Lane h, const Motion* d) {
  Motion out = {y->angle + h * d->angle, y->rate + h * d->rate, y->twist, y->twist_rate};
  if (features & TWIST) {
    out.twist = y->twist + h * d->twist;
    out.twist_rate = y->twist_rate + h * d->twist_rate;
  }
  return out;
}

// What the air sees at a stage `duration` after the step's start.
INLINE Lane lagged_there(const Runs* c, const State* s, int features, const vwt_lag* lag, Lane duration,
                         const Motion* y) {
  return features & LAG ? lagged_at(c, s, features, lag, duration, y) : s->lagged;
}

INLINE Motion stage_at(const Runs* c, const State* s, int features, const vwt_lag* lag, Lane duration,
                       const Instant* now, const Motion* y) {
  Powers powers;
  const Lane lagged = lagged_there(c, s, features, lag, duration, y);
  const Lane slip = features & DAHL ? bent_at(c, s, duration, y) / c->range : s->slip;
  return slope_at(c, features, now, y, lagged, slip, &powers);
}

INLINE Motion first_stage(const Runs* c, const State* s, int features, const Instant* now) {
  Powers powers;
  return slope_at(c, features, now, &s->y, s->lagged, features & DAHL ? s->deflection / c->range : s->slip, &powers);
}

INLINE Motion end_of(const State* s, int features, Lane h, const Motion k[4]) {
  const Motion mean = {
      (k[0].angle + 2 * (k[1].angle + k[2].angle) + k[3].angle) / 6,
      (k[0].rate + 2 * (k[1].rate + k[2].rate) + k[3].rate) / 6,
      (k[0].twist + 2 * (k[1].twist + k[2].twist) + k[3].twist) / 6,
      (k[0].twist_rate + 2 * (k[1].twist_rate + k[2].twist_rate) + k[3].twist_rate) / 6,
  };
  return along(features, &s->y, h, &mean);
}

// The motion after a step of length h.
INLINE Motion runge_kutta(const Runs* c, const State* s, const Input* in, int features, Lane h, Lane middle,
                          const vwt_lag* half, const vwt_lag* whole) {
  Motion y, k[4];
  Instant now = instant_at(c, in, features, s->start);
  k[0] = first_stage(c, s, features, &now);
  now = instant_at(c, in, features, s->start + middle);
  y = along(features, &s->y, middle, &k[0]);
  k[1] = stage_at(c, s, features, half, middle, &now, &y);
  y = along(features, &s->y, middle, &k[1]);
  k[2] = stage_at(c, s, features, half, middle, &now, &y);
  now = instant_at(c, in, features, s->start + h);
  y = along(features, &s->y, h, &k[2]);
  k[3] = stage_at(c, s, features, whole, h, &now, &y);
  return end_of(s, features, h, k);
}

// The state at the end of a step with this motion there; its time is the caller's.
INLINE void move(const Runs* c, State* s, int features, Lane h, const vwt_lag* whole, const Motion* to) {
  if (features & LAG) {
    s->lagged = lagged_at(c, s, features, whole, h, to);
  }
  if (features & DAHL) {
    s->deflection = bent_at(c, s, h, to);
  }
  s->y.angle = to->angle;
  s->y.rate = to->rate;
  if (features & TWIST) {
    s->y.twist = to->twist;
    s->y.twist_rate = to->twist_rate;
  }
}

// The motion at a share u of a step of length h, cubic (Hermite).
INLINE void between(Lane h, double u, Lane angle0, Lane rate0, Lane angle1, Lane rate1, Lane* angle, Lane* rate) {
  const Lane change = angle1 - angle0, c1 = h * rate0;
  const Lane c2 = 3 * change - h * (2 * rate0 + rate1);
  const Lane c3 = h * (rate0 + rate1) - 2 * change;
  *angle = angle0 + u * (c1 + u * (c2 + u * c3));
  *rate = (c1 + u * (2 * c2 + u * 3 * c3)) / h;
}

// Of the longest run; the others are followed beyond their ends.
INLINE int most_samples(const Runs* c) {
  double most = 0;
  for (int k = 0; k < c->count; k++) {
    most = fmax(most, c->run[k]->samples);
  }
  return (int)most;
}

INLINE void put_sample(const Runs* c, int at, Lane angles, Lane rates, double* const* angle, double* const* rate) {
  for (int k = 0; k < c->count; k++) {
    if (at < c->run[k]->samples) {
      angle[k][at] = AT(angles, k);
      rate[k][at] = AT(rates, k);
    }
  }
}

// One more than the index of the first run that has grown without bound, if it has not ended at a sample; 0: none.
INLINE int grown(const Runs* c, int sample, Lane angle) {
  for (int k = 0; k < c->count && !all(size_of(angle) < 1e6); k++) {
    if (!(fabs(AT(angle, k)) < 1e6) && sample < c->run[k]->samples) {
      return 1 + k;
    }
  }
  return 0;
}

// Fills angle and rate of the runs, sample by sample; `advance` makes a step. Returns as `vwt_forward`.
typedef void Advance(void* own, const Runs* c, State* s, int features);

INLINE int integrate(const Runs* c, State* s, int features, Advance* advance, void* own, double* const* angle,
                     double* const* rate) {
  const int samples = most_samples(c), steps = (int)c->run[0]->steps, stride = strides(c->run[0]);
  int failed = 0;
  for (int i = 0; i < samples && failed != 1; i += stride) {
    const State before = *s;
    put_sample(c, i, before.y.angle, before.y.rate, angle, rate);
    for (int j = 0; j < steps; j++) {
      advance(own, c, s, features);
      s->start = (i * (double)steps + stride * (j + 1)) * c->step;  // no drift of the clock
    }
    for (int j = 1; j < stride; j++) {
      Lane angles, rates;
      between(c->whole_step, j / (double)stride, before.y.angle, before.y.rate, s->y.angle, s->y.rate, &angles, &rates);
      put_sample(c, i + j, angles, rates, angle, rate);
    }
    const int now = grown(c, i, s->y.angle);
    failed = now && (!failed || now < failed) ? now : failed;
  }
  return failed;
}

#endif  // VWT_MOTION_H_
