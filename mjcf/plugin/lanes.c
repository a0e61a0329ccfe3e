// Plain runs integrated side by side, which keeps a processor's arithmetic units busy: the steps of one run wait for
// each other, those of several do not.

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

INLINE void step(void* alone, const Runs* c, State* s, int features) {
  const State before = *s;
  const Input in = input_of(c, features, s->start, c->half_step);
  const Motion to = runge_kutta(c, &before, &in, features, c->whole_step, c->half_step, c->half, c->whole);
  move(c, s, features, c->whole_step, c->whole, &to);
  turn(c, &before, s, alone);
}

CLONED int vwt_integrate_lanes(int count, const vwt_parameters* parameters, const vwt_run* runs,
                               double* const* angle, double* const* rate) {
  Runs c = {.count = 0};
  State s;
  Alone alone[VWT_LANES] = {{0}};
  release(count, parameters, runs, &c, &s);
  const int features = c.law.features & ~FORCED;
  // compiled apart: rods that twist, and the law of most runs, which has none of the features
  if (features & TWIST) {
    return integrate(&c, &s, features | TWIST, step, alone, angle, rate);
  }
  return features == 0 ? integrate(&c, &s, 0, step, alone, angle, rate)
                       : integrate(&c, &s, features & ~TWIST, step, alone, angle, rate);
}
