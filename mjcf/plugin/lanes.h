// Plain runs side by side, in lanes, which lanes.c and slopes.c share.

#ifndef VWT_LANES_H_
#define VWT_LANES_H_

#include "plain.h"
#include "single.h"

#define LAW_LANES VWT_LANES
#include "motion.h"

// Compiled for wide registers too, among which the loader chooses: no operation is fused, so the bits are the same.
#if VWT_WIDE
#define CLONED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLONED
#endif

_Static_assert(sizeof(State) == VWT_LANES * sizeof(vwt_point), "a point is a lane of a state");

// The input in a step from `start` on, whose middle is half a step later.
INLINE Input input_of(const Runs* c, int features, Lane start, Lane half) {
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

// The steps of the lanes that turn, made alone. It is rarely due, and its variables would take registers from a step.
static __attribute__((noinline, unused)) void step_turning(const Runs* c, const State* before, const Mask* turns,
                                                                 State* s, Alone* alone) {
  enum { NUMBERS = sizeof(State) / sizeof(Lane) };
  for (int k = 0; k < VWT_LANES; k++) {
    if (alone[k].passage) {
      alone[k].passage->count = 0;
    }
    if (!(*turns)[k]) {
      continue;
    }
    double at[NUMBERS];
    for (int i = 0; i < NUMBERS; i++) {
      at[i] = ((const Lane*)before)[i][k];
    }
    if (k < c->count && !alone[k].rests) {
      vwt_step_alone(c->law.p[k], c->run[k], c->whole_step[k], (vwt_point*)at, &alone[k]);
    }
    for (int i = 0; i < NUMBERS; i++) {
      ((Lane*)s)[i][k] = at[i];
    }
  }
}

// The lanes that reverse or stick in a step under Coulomb friction. The step has not followed them: they make it alone.
INLINE Mask turn(const Runs* c, const State* before, State* s, Alone* alone) {
  if (!c->rubs) {
    return (Mask){0};
  }
  const Mask slides = (before->y.rate != 0) & (s->y.rate * before->slip > 0), turns = c->dry & ~slides;
  if (all(~turns)) {
    return turns;
  }
  const State start = *before;
  State end = *s;
  step_turning(c, &start, &turns, &end, alone);
  *s = end;
  return turns;
}

#endif  // VWT_LANES_H_
