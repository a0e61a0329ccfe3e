// Derivatives of plain motions, by the terms of their law and by their start.
//
// A step of the Runge-Kutta method maps a small change of its start linearly on one of its end, and adds what a small
// change of a term does at the four stages. Both maps follow from the derivatives of the acceleration by the motion at
// the stages, once for all terms; each further term costs a few multiplications. The derivatives are those of the
// motion as it is integrated, except at a reversal under Coulomb friction, where they are those of the exact motion.

#include <math.h>

#include "forward.h"
#include "stages.h"

// What a step makes of a change of its start, and of a term's at its stages, in the angle or in the rate at its end.
typedef struct {
  Lane stage[4], angle, rate, lagged;
} Row;

// The row of a sum of the end's angle and rate with the weights `angle` and `rate`: the stages backwards.
INLINE Row row_of(const Slopes at[4], const LagSlopes* half, const LagSlopes* whole, Lane h, Lane middle, int features,
                  double angle, double rate) {
  Lane by_angle[4], by_rate[4];
  for (int i = 0; i < 4; i++) {
    by_angle[i] = at[i].by_angle;
    by_rate[i] = at[i].by_rate;
    if (features & LAG && i > 0) {
      const LagSlopes* l = i < 3 ? half : whole;
      by_angle[i] += at[i].by_lagged * l->angle1;
      by_rate[i] += at[i].by_lagged * l->rate1;
    }
  }
  const Lane sixth = h / 6, third = h / 3;
  Row out;
  out.stage[3] = rate * sixth;
  const Lane r4 = angle * sixth + out.stage[3] * by_rate[3], y4 = out.stage[3] * by_angle[3];
  out.stage[2] = rate * third + h * r4;
  const Lane r3 = angle * third + h * y4 + out.stage[2] * by_rate[2], y3 = out.stage[2] * by_angle[2];
  out.stage[1] = rate * third + middle * r3;
  const Lane r2 = angle * third + middle * y3 + out.stage[1] * by_rate[1], y2 = out.stage[1] * by_angle[1];
  out.stage[0] = rate * sixth + middle * r2;
  out.angle = angle + y4 + y3 + y2 + out.stage[0] * by_angle[0];
  out.rate = rate + angle * sixth + middle * y2 + r2 + r3 + r4 + out.stage[0] * by_rate[0];
  out.lagged = (Lane){0};
  if (features & LAG) {
    out.lagged = out.stage[0] * at[0].by_lagged;
    for (int i = 1; i < 4; i++) {
      const LagSlopes* l = i < 3 ? half : whole;
      const Lane seen = out.stage[i] * at[i].by_lagged;
      out.angle += seen * l->angle0;
      out.rate += seen * l->rate0;
      out.lagged += seen * l->lagged;
    }
  }
  return out;
}

// The motion after a step without a reversal, and the change there.
INLINE Motion advance(const Law* law, const State* s, int features, Lane h, Lane middle, const LagSlopes* half,
                      const LagSlopes* whole, int width, const int* columns, Change* change) {
  const Runs* c = law->c;
  const int lags = features & LAG;
  const Input in = input_of(c, features, s->start, middle);
  Slopes at[4];
  Motion y = s->y, k[4];
  Instant now = instant_at(c, &in, features, s->start);
  k[0] = evaluate(law, s->slip, features, &now, &y, s->lagged, &at[0]);
  now = instant_at(c, &in, features, s->start + middle);
  y = along(features, &s->y, middle, &k[0]);
  k[1] = evaluate(law, s->slip, features, &now, &y, lagged_there(c, s, features, half->lag, middle, &y), &at[1]);
  y = along(features, &s->y, middle, &k[1]);
  k[2] = evaluate(law, s->slip, features, &now, &y, lagged_there(c, s, features, half->lag, middle, &y), &at[2]);
  now = instant_at(c, &in, features, s->start + h);
  y = along(features, &s->y, h, &k[2]);
  k[3] = evaluate(law, s->slip, features, &now, &y, lagged_there(c, s, features, whole->lag, h, &y), &at[3]);
  const Motion to = end_of(s, features, h, k);
  Lane by_lag_after = {0};
  if (lags) {
    at[0].by_lag = (Lane){0};
    at[1].by_lag = at[1].by_lagged * by_lag(c, s, half, middle, at[1].angle, at[1].rate);
    at[2].by_lag = at[2].by_lagged * by_lag(c, s, half, middle, at[2].angle, at[2].rate);
    at[3].by_lag = at[3].by_lagged * by_lag(c, s, whole, h, at[3].angle, at[3].rate);
    by_lag_after = by_lag(c, s, whole, h, to.angle, to.rate);
  }
  const Row of_angle = row_of(at, half, whole, h, middle, features, 1, 0);
  const Row of_rate = row_of(at, half, whole, h, middle, features, 0, 1);
  for (int i = 0; i < width; i++) {
    const Lane angle0 = change->angle[i], rate0 = change->rate[i];
    Lane angle1 = of_angle.angle * angle0 + of_angle.rate * rate0;
    Lane rate1 = of_rate.angle * angle0 + of_rate.rate * rate0;
    if (lags) {
      angle1 += of_angle.lagged * change->lagged[i];
      rate1 += of_rate.lagged * change->lagged[i];
    }
    if (columns[i] < VWT_TERM_pace || columns[i] >= VWT_TERM_COUNT) {
      for (int j = 0; j < 4; j++) {
        const Lane term = by_term(law, features, columns[i], s->slip, &in, &at[j]);
        angle1 += of_angle.stage[j] * term;
        rate1 += of_rate.stage[j] * term;
      }
    }
    change->angle[i] = angle1;
    change->rate[i] = rate1;
    if (lags) {
      change->lagged[i] = whole->lagged * change->lagged[i] + whole->angle0 * angle0 + whole->rate0 * rate0 +
                          whole->angle1 * angle1 + whole->rate1 * rate1;
      if (columns[i] == VWT_TERM_lag) {
        change->lagged[i] += by_lag_after;
      }
    }
  }
  return to;
}

// The change over the stretches of a step in those lanes that have any; the other lanes keep theirs.
INLINE void pass(const Law* law, const State* before, int features, const Passage* passages, int width,
                 const int* columns, Change* change) {
  for (int i = 0; i < VWT_MOST_STRETCHES; i++) {
    State s = *before;
    Lane h = {0}, kept = (Lane){0} + 1;
    int found = 0, moves = 0;
    for (int k = 0; k < VWT_LANES; k++) {
      if (i >= passages[k].count) {
        continue;
      }
      const Stretch* at = &passages[k].stretch[i];
      found = 1;
      kept[k] = at->slip == 0 ? 0 : at->kept;
      if (at->slip != 0) {  // else it rests
        moves = 1;
        s.start[k] = at->start;
        s.y.angle[k] = at->angle;
        s.y.rate[k] = at->rate;
        s.lagged[k] = at->lagged;
        s.slip[k] = at->slip;
        h[k] = at->duration;
      }
    }
    if (!found) {
      return;
    }
    if (moves) {
      LagSlopes half = {0}, whole = {0};
      if (features & LAG) {
        half = lag_slopes(law->c, h / 2);
        whole = lag_slopes(law->c, h);
      }
      advance(law, &s, features, h, h / 2, &half, &whole, width, columns, change);
    }
    for (int j = 0; j < width; j++) {
      change->rate[j] *= kept;
    }
  }
}

typedef struct {
  int width, pace;  // the place of the step's own column, or -1
  const int* columns;
  LagSlopes half, whole;
} Asked;

INLINE void step(const Law* law, const Asked* asked, State* s, int features, Alone* alone, Passage* passages,
                 Change* change) {
  const Runs* c = law->c;
  const State before = *s;
  Change old;
  for (int i = 0; c->rubs && i < asked->width; i++) {
    old.angle[i] = change->angle[i];
    old.rate[i] = change->rate[i];
    old.lagged[i] = change->lagged[i];
  }
  const Motion to = advance(law, &before, features, c->whole_step, c->half_step, &asked->half, &asked->whole,
                            asked->width, asked->columns, change);
  move(c, s, features, c->whole_step, c->whole, &to);
  const Mask turns = turn(c, &before, s, alone);
  if (all(~turns)) {
    return;
  }
  for (int i = 0; i < asked->width; i++) {
    change->angle[i] = choose(turns, old.angle[i], change->angle[i]);
    change->rate[i] = choose(turns, old.rate[i], change->rate[i]);
    change->lagged[i] = choose(turns, old.lagged[i], change->lagged[i]);
  }
  pass(law, &before, features, passages, asked->width, asked->columns, change);
}

// Where the results go.
typedef struct {
  int size, width;  // samples in a row of the arrays, and columns
  double *const *angle, *const *rate, *const *angle_slopes, *const *rate_slopes;
  const double* const* weights;
  int weighed;
} Out;

// The change of angle and rate at a sample by column.
typedef struct {
  Lane angle[VWT_MOST_COLUMNS], rate[VWT_MOST_COLUMNS];
} Seen;

INLINE void copy(int width, const Seen* from, Seen* to) {
  for (int i = 0; i < width; i++) {
    to->angle[i] = from->angle[i];
    to->rate[i] = from->rate[i];
  }
}

// The change as it is seen: with a longer step, the motion is seen at a later time.
INLINE void see(const Law* law, const Asked* asked, int features, const State* s, const Change* change, Seen* out) {
  for (int i = 0; i < asked->width; i++) {
    out->angle[i] = change->angle[i];
    out->rate[i] = change->rate[i];
  }
  if (asked->pace >= 0) {
    const Lane none = {0};
    const Input in = input_of(law->c, features, s->start, law->c->half_step);
    const Instant now = instant_at(law->c, &in, features, s->start);
    Powers powers;
    const Lane a = slope_at(law->c, features, &now, &s->y, s->lagged, s->slip, &powers).rate;
    const Mask rests = law->c->dry & (s->y.rate == 0);
    out->angle[asked->pace] = s->start * s->y.rate;
    out->rate[asked->pace] = choose(rests, none, s->start * a);
  }
}

// Writes a sample of the motions, and its change.
INLINE void put(const Out* out, const Runs* c, int at, Lane angle, Lane rate, const Seen* change) {
  for (int k = 0; k < c->count; k++) {
    if (at >= c->run[k]->samples) {
      continue;
    }
    out->angle[k][at] = angle[k];
    out->rate[k][at] = rate[k];
    for (int i = 0; !out->weights && i < out->width; i++) {
      out->angle_slopes[k][(long)i * out->size + at] = change->angle[i][k];
      out->rate_slopes[k][(long)i * out->size + at] = change->rate[i][k];
    }
  }
}

// Writes the change of the mean of a block from the changes at its ends.
INLINE void put_means(const Out* out, const Runs* c, int at, const Seen* from, const Seen* to) {
  Lane w[4] = {{0}};
  const int place = at < out->weighed ? at : 0;
  for (int n = 0; n < 4; n++) {
    for (int k = 0; k < c->count; k++) {
      w[n][k] = out->weights[k][n * out->weighed + place];
    }
  }
  for (int i = 0; i < out->width; i++) {
    const Lane mean = w[0] * from->angle[i] + w[1] * to->angle[i] + w[2] * from->rate[i] + w[3] * to->rate[i];
    for (int k = 0; k < c->count; k++) {
      if (at + 1 < c->run[k]->samples) {
        out->angle_slopes[k][(long)i * (out->size - 1) + at] = mean[k];
      }
    }
  }
}

// Whether a run's motion has derivatives here: friction as a root of the rate is infinitely steep at a reversal, that
// with a load has none by gravity's terms, and Dahl's none yet.
static int is_smooth(const vwt_parameters* p) {
  const int root = p->friction_moment > 0 && p->friction_exponent > 0 && p->friction_exponent < 1;
  return !root && !bends(p) && p->friction_load == 0;
}

// Whether a term of one lane has a derivative.
static int exists(const Runs* c, int k, int term) {
  const vwt_parameters* p = c->law.p[k];
  switch (term) {
    case VWT_TERM_friction:
      return p->friction_moment > 0;
    case VWT_TERM_friction_load:  // exists on one side only
      return 0;
    case VWT_TERM_friction_exponent:
      return p->friction_moment > 0 && p->friction_exponent >= 1;
    case VWT_TERM_friction_saturation:
      return p->friction_moment > 0 && p->friction_saturation != 0;
    case VWT_TERM_friction_peak_rate:
    case VWT_TERM_friction_peak:
      return p->friction_moment > 0 && p->friction_peak_rate != 0;
    case VWT_TERM_shedding_sine:
    case VWT_TERM_shedding_cosine:
    case VWT_TERM_turn:
      return c->wake.shedding[k] != 0;
    case VWT_TERM_seen:
      return c->wake.lag[k] != 0 || is_sampled(c, k);
    case VWT_TERM_lag:
    case VWT_TERM_start_lagged:
      return c->wake.lag[k] != 0;
    case VWT_TERM_air_rate:
      return is_sampled(c, k);
    default:
      return term < VWT_TERM_COUNT || is_sampled(c, k) || is_driven(c, k);
  }
}

INLINE int differentiated(const Law* law, const Asked* asked, State* s, int features, Alone* alone, Passage* passages,
                     const Out* out) {
  const Runs* c = law->c;
  const int samples = most_samples(c), steps = (int)c->run[0]->steps, width = asked->width;
  const int stride = strides(c->run[0]);
  Change change;
  for (int i = 0; i < width; i++) {
    const int term = asked->columns[i];
    const Lane none = {0}, one = none + 1;
    change.angle[i] = term == VWT_TERM_start_angle ? one : none;
    change.rate[i] = term == VWT_TERM_start_rate ? one : none;
    change.lagged[i] = term == VWT_TERM_start_lagged ? c->body : none;
    for (int k = 0; k < c->count; k++) {
      if (!exists(c, k, term)) {
        change.angle[i][k] = change.rate[i][k] = change.lagged[i][k] = NAN;
      }
    }
  }
  Seen first, last, next, seen;
  see(law, asked, features, s, &change, &seen);
  put(out, c, 0, s->y.angle, s->y.rate, &seen);
  for (int i = 0; i + 1 < samples; i += stride) {
    const State before = *s;
    copy(width, &seen, &first);
    copy(width, &seen, &last);
    for (int j = 0; j < steps; j++) {
      step(law, asked, s, features, alone, passages, &change);
      s->start = (i * (double)steps + stride * (j + 1)) * c->step;  // no drift of the clock
    }
    const int failed = grown(c, i + 1, s->y.angle);
    if (failed) {
      return failed;
    }
    see(law, asked, features, s, &change, &seen);
    for (int j = 1; j < stride && i + j < samples; j++) {
      const double u = j / (double)stride;
      Lane y, r;
      between(c->whole_step, u, before.y.angle, before.y.rate, s->y.angle, s->y.rate, &y, &r);
      for (int n = 0; n < width; n++) {
        const int longer = n == asked->pace;  // the rates times the step change with the step too
        const Lane rate0 = longer ? first.rate[n] + before.y.rate : first.rate[n];
        const Lane rate1 = longer ? seen.rate[n] + s->y.rate : seen.rate[n];
        between(c->whole_step, u, first.angle[n], rate0, seen.angle[n], rate1, &next.angle[n], &next.rate[n]);
        next.rate[n] = longer ? next.rate[n] - r : next.rate[n];
      }
      put(out, c, i + j, y, r, &next);
      if (out->weights) {
        put_means(out, c, i + j - 1, &last, &next);
        copy(width, &next, &last);
      }
    }
    if (i + stride < samples) {
      put(out, c, i + stride, s->y.angle, s->y.rate, &seen);
      if (out->weights) {
        put_means(out, c, i + stride - 1, &last, &seen);
      }
    }
  }
  return 0;
}

CLONED static int slopes_of_lanes(int count, const vwt_parameters* parameters, const vwt_run* runs, int width,
                                  const int* columns, const double* const* changes, const Out* out) {
  Runs c = {.count = 0};
  State s;
  Alone alone[VWT_LANES] = {{0}};
  Passage passages[VWT_LANES];
  release(count, parameters, runs, &c, &s);
  for (int k = 0; k < VWT_LANES; k++) {
    alone[k].passage = &passages[k];
  }
  Law law = law_of(&c);
  for (int k = 0; k < VWT_LANES; k++) {
    law.changes[k] = changes ? changes[k < count ? k : 0] : 0;
  }
  Asked asked = {.width = width, .columns = columns, .pace = -1};
  for (int i = 0; i < width; i++) {
    asked.pace = columns[i] == VWT_TERM_pace ? i : asked.pace;
  }
  if (law.features & LAG) {
    asked.half = lag_slopes(&c, c.half_step);
    asked.whole = lag_slopes(&c, c.whole_step);
  }
  const int features = law.features & ~(FORCED | TWIST | DAHL | PROGRAM | LOAD);  // vwt_slopes refuses these
  return features == 0 ? differentiated(&law, &asked, &s, 0, alone, passages, out)
                       : differentiated(&law, &asked, &s, features, alone, passages, out);
}

int vwt_slopes(int count, const vwt_parameters* parameters, const vwt_run* runs, int size, int width,
               const int* columns, const double* const* changes, const double* const* weights, int weighed,
               double* const* angle, double* const* rate, double* const* angle_slopes, double* const* rate_slopes) {
  for (int i = 0; i < count; i++) {
    if (!vwt_is_plain(&parameters[i], &runs[i]) || twists(&runs[i]) || runs[i].program_count > 0 ||
        !is_smooth(&parameters[i])) {
      return -1;
    }
  }
  for (int i = 0; i < count;) {
    int together = 1;
    while (together < VWT_LANES && i + together < count &&
           vwt_alike(&parameters[i], &runs[i], &parameters[i + together], &runs[i + together])) {
      together++;
    }
    const Out out = {.size = size, .width = width, .angle = &angle[i], .rate = &rate[i],
                     .angle_slopes = &angle_slopes[i], .rate_slopes = weights ? 0 : &rate_slopes[i],
                     .weights = weights ? &weights[i] : 0, .weighed = weighed};
    const int failed = slopes_of_lanes(together, &parameters[i], &runs[i], width, columns, changes ? &changes[i] : 0, &out);
    if (failed) {
      return i + failed;
    }
    i += together;
  }
  return 0;
}

void vwt_terms(int count, const vwt_parameters* parameters, const vwt_run* runs, double* values) {
  for (int i = 0; i < count; i += VWT_LANES) {
    Runs c = {.count = 1};
    for (int k = 0; k < VWT_LANES; k++) {
      const int at = i + k < count ? i + k : i;
      set_run(&c, k, &parameters[at], &runs[at]);
    }
    const Law law = law_of(&c);
    for (int k = 0; k < VWT_LANES && i + k < count; k++) {
      set_terms(&law, k, &runs[i + k], values + (long)(i + k) * VWT_TERM_COUNT);
    }
  }
}
