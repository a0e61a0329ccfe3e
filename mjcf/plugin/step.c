#include "step.h"

#include <math.h>

#include "expression.h"
#include "moment.h"

static const double kReached = 1e-6;  // of an interval: a shorter part of one is rounding

static double wind_at(const vwt_run* run, double time) {
  return fmax(0, vwt_series(run->wind, (int)run->wind_count, run->wind_interval, time));
}

static double body_angle(const vwt_run* run, const Motion* y) { return (1 + run->lead) * y->angle + y->twist; }
static double body_rate(const vwt_run* run, const Motion* y) { return (1 + run->lead) * y->rate + y->twist_rate; }

static const double* lag_weights(LagWeights* known, double z) {
  for (int i = 0; i < 2; i++) {
    if (known->z[i] == z) {
      return known->w[i];
    }
  }
  known->last = !known->last;
  known->z[known->last] = z;
  vwt_lag_weights(z, known->w[known->last]);
  return known->w[known->last];
}

// The lag's state `duration` s after the step's start.
static double lagged_at(const Step* s, double duration, const Motion* y) {
  const double lag = vwt_lag_time(s->p, wind_at(s->run, s->start + 0.5 * duration));
  if (lag == 0) {
    return body_angle(s->run, y);
  }
  if (!(duration > 0)) {
    return s->lagged;
  }
  return vwt_lag_weighted(lag_weights(s->weights, duration / fabs(lag)), s->lagged, duration,
                          body_angle(s->run, &s->from), body_rate(s->run, &s->from), body_angle(s->run, y),
                          body_rate(s->run, y));
}

// The drive's moment at a time within the step, N m, where it acts on the rod's upper end (1) or on the body (0).
static double drive_at(const Step* s, double time, int on_end) {
  if (s->run->moment_count == 0 || (s->run->moment_on_end != 0) != on_end) {
    return 0;
  }
  return s->moment + s->moment_slope * (time - s->moment_from);
}

// The angle of the spring's root, rad, which a drive on the rod's upper end moves.
static double root_at(const Step* s, double time) {
  const double moment = drive_at(s, time, 1);
  return moment != 0 && s->p->spring_stiffness > 0 ? moment / s->p->spring_stiffness : 0;
}

// The moment of the surroundings on the body, N m.
static double ambient_at(const vwt_run* run, double time) {
  return run->ambient_count > 0 ? vwt_series(run->ambient, (int)run->ambient_count, run->ambient_interval, time) : 0;
}

static double air_at(const Step* s, double duration, const Motion* y) {
  const double time = s->start + duration;
  const vwt_air_state air = {
      .time = time,
      .wind_speed = wind_at(s->run, time),
      .angle = body_angle(s->run, y),
      .rate = body_rate(s->run, y),
      .lagged = s->p->aero_lag != 0 ? lagged_at(s, duration, y) : 0,
      .forcing = s->run->forcing_count > 0 ? vwt_series(s->run->forcing, (int)s->run->forcing_count,
                                                        s->run->forcing_interval, time)
                                           : 0,
  };
  return vwt_air_moment(s->p, &air) + drive_at(s, time, 0) + ambient_at(s->run, time);
}

// The moment that the joint carries, on which friction may depend, N m.
static double load_at(const Step* s, double time, const Motion* y) {
  return s->p->friction_load != 0 ? vwt_load(s->p, y->angle, drive_at(s, time, 0)) : 0;
}

// The moment stated as an expression.
static double stated_moment(const Step* s, double time, const Motion* y) {
  const vwt_program program = {s->run->program, (int)s->run->program_count};
  if (program.count == 0) {
    return 0;
  }
  const vwt_program_input in = {y->angle, y->rate, time, wind_at(s->run, time)};
  return vwt_program_value(&program, &in);
}

// Moments on the rod's upper end except friction; with a rigid rod they include the aerodynamic moment.
static double other_moment(const Step* s, double air, double time, const Motion* y) {
  const vwt_parameters* p = s->p;
  const double mechanism = vwt_mechanism_moment(p, y->angle, y->angle - root_at(s, time), y->rate) +
                           stated_moment(s, time, y) + drive_at(s, time, 1) - p->spring_stiffness * y->angle - p->mechanical_damping * y->rate;
  if (s->run->twist_stiffness > 0) {
    return mechanism + s->run->twist_stiffness * y->twist + s->run->twist_damping * y->twist_rate;
  }
  return mechanism + (1 + s->run->lead) * air - s->run->rod_stiffness * y->angle;
}

static double deflection_at(const Step* s, double duration, const Motion* y) {
  return vwt_presliding_advance(s->range, s->deflection, duration, s->from.angle, s->from.rate, y->angle,
                                y->rate);
}

// Time derivative of the motion with the step's sign of friction, `duration` s after the step's start.
static Motion derivative(const Step* s, double duration, const Motion* y) {
  const vwt_parameters* p = s->p;
  const double time = s->start + duration, air = air_at(s, duration, y);
  const int coulomb = !(s->range > 0);
  const double along = coulomb ? s->slip * y->rate : fabs(y->rate);
  const double friction = (coulomb ? -s->slip : -deflection_at(s, duration, y) / s->range) *
                          vwt_friction_level(p, s->least_rate, along, load_at(s, time, y));
  const int stuck = coulomb && vwt_rubs(p) && s->slip == 0;
  Motion d = {y->rate, 0, y->twist_rate, 0};
  if (s->run->twist_stiffness > 0) {
    const double share = s->run->inertia_share;
    const double rod = s->run->twist_stiffness * y->twist + s->run->twist_damping * y->twist_rate;
    d.rate = stuck ? 0 : (other_moment(s, air, time, y) + friction) / (share * p->yaw_inertia);
    d.twist_rate = (air - rod) / ((1 - share) * p->yaw_inertia) - d.rate;
  } else {
    d.rate = stuck ? 0 : (other_moment(s, air, time, y) + friction) / p->yaw_inertia;
  }
  if (stuck) {
    d.angle = 0;
  }
  return d;
}

static Motion along(const Motion* y, double h, const Motion* d) {
  const Motion out = {y->angle + h * d->angle, y->rate + h * d->rate, y->twist + h * d->twist,
                      y->twist_rate + h * d->twist_rate};
  return out;
}

static Motion runge_kutta(const Step* s, double h) {
  const Motion k1 = derivative(s, 0, &s->from);
  const Motion y2 = along(&s->from, h / 2, &k1), k2 = derivative(s, h / 2, &y2);
  const Motion y3 = along(&s->from, h / 2, &k2), k3 = derivative(s, h / 2, &y3);
  const Motion y4 = along(&s->from, h, &k3), k4 = derivative(s, h, &y4);
  const Motion mean = {
      (k1.angle + 2 * (k2.angle + k3.angle) + k4.angle) / 6,
      (k1.rate + 2 * (k2.rate + k3.rate) + k4.rate) / 6,
      (k1.twist + 2 * (k2.twist + k3.twist) + k4.twist) / 6,
      (k1.twist_rate + 2 * (k2.twist_rate + k3.twist_rate) + k4.twist_rate) / 6,
  };
  return along(&s->from, h, &mean);
}

static void move(Step* s, double h, const Motion* to) {
  if (s->p->aero_lag != 0) {
    s->lagged = lagged_at(s, h, to);
  }
  if (s->range > 0) {
    s->deflection = deflection_at(s, h, to);
  }
  s->from = *to;
  s->start += h;
}

void vwt_step(Step* s, double h) {
  const Motion y = runge_kutta(s, h);
  move(s, h, &y);
}

// Sign of the slip that starts from rest in the present state; 0 while friction sticks.
static int slip_from_rest(const Step* s) {
  const double other = other_moment(s, air_at(s, 0, &s->from), s->start, &s->from);
  const double limit = vwt_friction_level(s->p, s->least_rate, 0, load_at(s, s->start, &s->from));
  return fabs(other) <= limit ? 0 : other > 0 ? 1 : -1;
}

// Length of the step after which the rate is zero, by Newton's method on repeated steps, kept between a length with
// the first rate's sign and one with the last's.
static double reversal(const Step* s, double h, double end_rate) {
  double low = 0, high = h, at = h * s->from.rate / (s->from.rate - end_rate);
  for (int i = 0; i < 60 && high - low > 1e-13; i++) {
    const Motion y = runge_kutta(s, at);
    if ((y.rate > 0) == (end_rate > 0)) {
      high = at;
    } else {
      low = at;
    }
    const double next = at - y.rate / derivative(s, at, &y).rate;
    if (fabs(next - at) < 1e-7 * h) {  // the error left is that squared
      return next;
    }
    at = next > low && next < high ? next : 0.5 * (low + high);
  }
  return high;
}

// As `move`, with a note of the stretch.
static void slide(Step* s, double h, const Motion* to) {
  if (s->passage) {
    const Stretch stretch = {s->start, h, s->from.angle, s->from.rate, s->lagged, s->slip, 1};
    s->passage->stretch[s->passage->count++] = stretch;
  }
  move(s, h, to);
}

// Notes of a reversal how much of a small change of the rate is left after it. The change moves the reversal in time,
// and the acceleration is another before it than after it.
static void note_reversal(Step* s, double before) {
  Stretch* ended = &s->passage->stretch[s->passage->count - 1];
  ended->kept = s->slip == 0 ? 0 : derivative(s, 0, &s->from).rate / before;
}

void vwt_step_with_friction(Step* s, double h) {
  double left = h, before = 0;  // the acceleration before a reversal, where it is noted
  if (s->passage) {
    s->passage->count = 0;
  }
  for (int i = 0; i < 8 && left > 0; i++) {
    if (s->from.rate == 0) {
      s->slip = slip_from_rest(s);
      if (s->passage && i > 0) {
        note_reversal(s, before);
      }
    }
    const Motion y = runge_kutta(s, left);
    if (s->slip == 0 || y.rate * s->slip > 0) {
      slide(s, left, &y);
      return;
    }
    if (s->from.rate * s->slip <= 0) {  // a slip that has just started from rest stops at once: stick
      s->slip = 0;
      const Motion held = runge_kutta(s, left);
      slide(s, left, &held);
      return;
    }
    const double part = reversal(s, left, y.rate);
    Motion at = runge_kutta(s, part);
    at.rate = 0;
    before = s->passage ? derivative(s, part, &at).rate : 0;
    slide(s, part, &at);
    left -= part;
  }
  if (left > 0) {  // chattering: friction sticks for the rest of the step
    s->slip = 0;
    s->from.rate = 0;
    const Motion held = runge_kutta(s, left);
    slide(s, left, &held);
  }
}

// The motion at a share u of a step of length h, cubic (Hermite).
static void between(const Motion* from, const Motion* to, double h, double u, double* angle, double* rate) {
  const double change = to->angle - from->angle;
  const double c1 = h * from->rate;
  const double c2 = 3 * change - h * (2 * from->rate + to->rate);
  const double c3 = h * (from->rate + to->rate) - 2 * change;
  *angle = from->angle + u * (c1 + u * (c2 + u * c3));
  *rate = (c1 + u * (2 * c2 + u * 3 * c3)) / h;
}

void vwt_fill(const Motion* from, const Motion* to, double h, int stride, int at, int samples, double* angle,
              double* rate) {
  for (int k = 1; k < stride && at + k < samples; k++) {
    between(from, to, h, k / (double)stride, &angle[at + k], &rate[at + k]);
  }
}

Step vwt_release(const vwt_parameters* p, const vwt_run* run, LagWeights* weights) {
  const double share = run->twist_stiffness > 0 ? run->inertia_share : 1;
  const Step s = {.p = p,
                  .run = run,
                  .least_rate = vwt_friction_least_rate(p, share * p->yaw_inertia, run->step),
                  .from = {run->angle, run->rate, run->twist, run->twist_rate},
                  .lagged = run->lagged,
                  .slip = run->rate > 0 ? 1 : run->rate < 0 ? -1 : 0,
                  .sample = -1,
                  .weights = weights};
  return s;
}

double vwt_set_drive(Step* s) {
  const vwt_run* run = s->run;
  const int last = (int)run->moment_count - 1;
  const double delay = run->moment_delay, *time = run->moment_time;
  // a sample that rounding puts just after the step's start counts as reached
  while (s->sample < last &&
         time[s->sample + 1] + delay <= s->start + kReached * (last > 0 ? time[1] - time[0] : 0)) {
    s->sample++;
  }
  const int at = s->sample < 0 ? 0 : s->sample;
  s->moment = run->moment_scale * run->moment[at] + run->moment_offset;
  s->moment_slope = 0;
  s->moment_from = time[at] + delay;
  if (run->moment_slope) {
    s->moment_slope = s->sample < 0 ? 0 : run->moment_scale * run->moment_slope[at];
  } else if (s->sample >= 0 && s->sample < last && run->moment_held == 0) {
    s->moment_slope = run->moment_scale * (run->moment[at + 1] - run->moment[at]) / (time[at + 1] - time[at]);
  }
  return s->sample < last ? time[s->sample + 1] + delay : INFINITY;
}
