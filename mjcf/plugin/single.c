#include "single.h"

#include <string.h>

#include "motion.h"

static const double kReached = 1e-6;  // of a step or an interval: a shorter part of one is rounding

typedef struct {
  Runs c;
  State s;
  Input in;
  int sample;  // of the drive, at the step's start; -1 before the first
  Passage* passage;
} Single;

_Static_assert(sizeof(State) == sizeof(vwt_point), "a point is a state of width 1");

// The motion after a step of length h.
static Motion moved(Single* one, double h) {
  if (one->c.law.features & LAG) {
    for (int i = 0; i < 2; i++) {
      const double duration = i ? h : h / 2;
      const double lag = vwt_lag_time(one->c.law.p[0], wind_at(one->c.run[0], one->s.start + 0.5 * duration));
      vwt_set_lag(i ? one->c.whole : one->c.half, lag, duration);
    }
  }
  return runge_kutta(&one->c, &one->s, &one->in, one->c.law.features, h, h / 2, one->c.half, one->c.whole);
}

// The slope at a motion `duration` after the step's start: 0, or the length of the last step that was tried.
static Motion slope(const Single* one, double duration, const Motion* y) {
  const Runs* c = &one->c;
  const int features = c->law.features, later = features & LAG && duration > 0;
  const double lagged = later ? lagged_at(c, &one->s, features, c->whole, duration, y) : one->s.lagged;
  const Instant now = instant_at(c, &one->in, features, one->s.start + duration);
  Powers powers;
  return slope_at(c, features, &now, y, lagged, one->s.slip, &powers);
}

static void arrive(Single* one, double h, const Motion* to) {
  move(&one->c, &one->s, one->c.law.features, h, one->c.whole, to);
  one->s.start += h;
}

// Sign of the slip that starts from rest in the present state; 0 while friction sticks.
static int slip_from_rest(const Single* one) {
  const Runs* c = &one->c;
  const Motion* y = &one->s.y;
  const Instant now = instant_at(c, &one->in, c->law.features, one->s.start);
  Powers powers;
  double air;
  const double other = moment_at(c, c->law.features, &now, y, one->s.lagged, &air, &powers);
  return fabs(other) <= friction_at(c, c->law.features, &now, y->angle, 0) ? 0 : other > 0 ? 1 : -1;
}

// Length of the step after which the rate is zero, by Newton's method on repeated steps, kept between a length with
// the first rate's sign and one with the last's.
static double reversal(Single* one, double h, double end_rate) {
  double low = 0, high = h, at = h * one->s.y.rate / (one->s.y.rate - end_rate);
  for (int i = 0; i < 60 && high - low > 1e-13; i++) {
    const Motion y = moved(one, at);
    if ((y.rate > 0) == (end_rate > 0)) {
      high = at;
    } else {
      low = at;
    }
    const double next = at - y.rate / slope(one, at, &y).rate;
    if (fabs(next - at) < 1e-7 * h) {  // the error left is that squared
      return next;
    }
    at = next > low && next < high ? next : 0.5 * (low + high);
  }
  return high;
}

// As `arrive`, with a note of the stretch.
static void slide(Single* one, double h, const Motion* to) {
  if (one->passage) {
    const State* s = &one->s;
    const Stretch stretch = {s->start, h, s->y.angle, s->y.rate, s->lagged, (int)s->slip, 1};
    one->passage->stretch[one->passage->count++] = stretch;
  }
  arrive(one, h, to);
}

// Friction sticks for a time.
static void stick(Single* one, double h) {
  one->s.slip = 0;
  const Motion held = moved(one, h);
  slide(one, h, &held);
}

// Notes of a reversal how much of a small change of the rate is left after it. The change moves the reversal in time,
// and the acceleration is another before it than after it.
static void note_reversal(Single* one, double before) {
  Stretch* ended = &one->passage->stretch[one->passage->count - 1];
  ended->kept = one->s.slip == 0 ? 0 : slope(one, 0, &one->s.y).rate / before;
}

// A step with Coulomb friction: it ends early at each reversal, where the body sticks or slips back.
static void step_with_friction(Single* one, double h) {
  double left = h, before = 0;  // the acceleration before a reversal, where it is noted
  State* s = &one->s;
  if (one->passage) {
    one->passage->count = 0;
  }
  for (int i = 0; i < 8 && left > 0; i++) {
    if (s->y.rate == 0) {
      s->slip = slip_from_rest(one);
      if (one->passage && i > 0) {
        note_reversal(one, before);
      }
    }
    const Motion y = moved(one, left);
    if (s->slip == 0 || y.rate * s->slip > 0) {
      slide(one, left, &y);
      return;
    }
    if (s->y.rate * s->slip <= 0) {  // a slip that has just started from rest stops at once
      stick(one, left);
      return;
    }
    const double part = reversal(one, left, y.rate);
    Motion at = moved(one, part);
    at.rate = 0;
    before = one->passage ? slope(one, part, &at).rate : 0;
    slide(one, part, &at);
    left -= part;
  }
  if (left > 0) {  // chattering: friction sticks for the rest of the step
    s->y.rate = 0;
    stick(one, left);
  }
}

// The drive from the step's start on. Returns the time of its next sample, s, or infinity after the last.
static double set_drive(Single* one) {
  const vwt_run* run = one->c.run[0];
  const int last = (int)run->moment_count - 1;
  const double delay = run->moment_delay, *time = run->moment_time;
  Input* in = &one->in;
  // a sample that rounding puts just after the step's start counts as reached
  while (one->sample < last &&
         time[one->sample + 1] + delay <= one->s.start + kReached * (last > 0 ? time[1] - time[0] : 0)) {
    one->sample++;
  }
  const int at = one->sample < 0 ? 0 : one->sample;
  in->value = run->moment_scale * run->moment[at] + run->moment_offset;
  in->slope = 0;
  in->from = time[at] + delay;
  if (run->moment_slope) {
    in->slope = one->sample < 0 ? 0 : run->moment_scale * run->moment_slope[at];
  } else if (one->sample >= 0 && one->sample < last && run->moment_held == 0) {
    in->slope = run->moment_scale * (run->moment[at + 1] - run->moment[at]) / (time[at + 1] - time[at]);
  }
  return one->sample < last ? time[one->sample + 1] + delay : INFINITY;
}

static void step(Single* one, double h) {
  if (one->c.rubs) {
    step_with_friction(one, h);
  } else {
    const Motion y = moved(one, h);
    arrive(one, h, &y);
  }
}

// A step that ends early at each sample of the drive, where the drive has a kink.
static void advance(void* own, const Runs* c, State* s, int features) {
  Single* one = own;
  const double h = c->whole_step, end = s->start + h, least = kReached * h;
  while (features & DRIVE) {
    const double next = set_drive(one), left = end - s->start;
    if (!(next < end - least)) {
      step(one, left);
      return;
    }
    step(one, next - s->start);
    s->start = next;
  }
  step(one, h);
}

int vwt_integrate_alone(const vwt_parameters* p, const vwt_run* run, double* angle, double* rate) {
  Single one = {.sample = -1};
  release(1, p, run, &one.c, &one.s);
  return integrate(&one.c, &one.s, one.c.law.features, advance, &one, &angle, &rate);
}

void vwt_step_alone(const vwt_parameters* p, const vwt_run* run, double h, vwt_point* at, Alone* alone) {
  const vwt_point before = *at;
  Single one = {.sample = alone->begun ? alone->sample : -1, .passage = alone->passage};
  one.c.half[0] = alone->half;
  one.c.whole[0] = alone->whole;
  set_run(&one.c, 0, p, run);
  memcpy(&one.s, at, sizeof(*at));
  if (run->moment_count > 0) {
    set_drive(&one);
  }
  step_with_friction(&one, h);
  memcpy(at, &one.s, sizeof(*at));
  alone->half = one.c.half[0];
  alone->whole = one.c.whole[0];
  alone->begun = 1;
  alone->sample = one.sample;
  const int changed = at->rate != 0 || before.rate != 0 || at->angle != before.angle || at->lagged != before.lagged;
  alone->rests = !changed && !(one.c.law.features & (SHEDDING | WIND | DRIVE | PROGRAM | TWIST));
}
