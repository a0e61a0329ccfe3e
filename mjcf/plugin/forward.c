#include "forward.h"

#include <math.h>

#include "moment.h"
#include "plain.h"
#include "step.h"

static const double kReached = 1e-6;  // of a step: a shorter part of one is rounding

// A step that ends early at each sample of the drive, where the drive has a kink.
static void step_with_drive(Step* s, double h, int coulomb) {
  const double end = s->start + h, least = kReached * h;
  for (;;) {
    const double next = vwt_set_drive(s), left = end - s->start;
    const double part = next < end - least ? next - s->start : left;
    if (coulomb) {
      vwt_step_with_friction(s, part);
    } else {
      vwt_step(s, part);
    }
    if (part == left) {
      return;
    }
    s->start = next;
  }
}

static int integrate(const vwt_parameters* p, const vwt_run* run, double* angle, double* rate) {
  LagWeights weights = {{0}, {{0}}, 0};
  Step s = vwt_release(p, run, &weights);
  const int samples = (int)run->samples, steps = (int)run->steps;
  const int coulomb = vwt_rubs(p) && !(p->presliding > 0);
  if (p->presliding > 0) {
    const double share = run->twist_stiffness > 0 ? run->inertia_share : 1;
    s.range = vwt_presliding_range(p, share * p->yaw_inertia, run->step);
  }
  const int stride = run->stride > 1 && steps == 1 ? (int)run->stride : 1;
  const double h = stride * run->step;
  for (int i = 0; i < samples; i += stride) {
    const Motion before = s.from;
    angle[i] = before.angle;
    rate[i] = before.rate;
    for (int k = 0; k < steps; k++) {
      if (run->moment_count > 0) {
        step_with_drive(&s, h, coulomb);
      } else if (coulomb) {
        vwt_step_with_friction(&s, h);
      } else {
        vwt_step(&s, h);
      }
      s.start = (i * (double)steps + stride * (k + 1)) * run->step;  // no drift of the clock
    }
    vwt_fill(&before, &s.from, h, stride, i, samples, angle, rate);
    if (!(fabs(s.from.angle) < 1e6)) {
      return 1;
    }
  }
  return 0;
}

int vwt_forward(int count, const vwt_parameters* parameters, const vwt_run* runs, double* const* angle,
                double* const* rate) {
  for (int i = 0; i < count;) {
    int side_by_side = 0;
    while (side_by_side < VWT_LANES && i + side_by_side < count &&
           vwt_is_plain(&parameters[i + side_by_side], &runs[i + side_by_side]) &&
           vwt_alike(&parameters[i], &runs[i], &parameters[i + side_by_side], &runs[i + side_by_side])) {
      side_by_side++;
    }
    const int failed = side_by_side > 0
                           ? vwt_integrate_lanes(side_by_side, &parameters[i], &runs[i], &angle[i], &rate[i])
                           : integrate(&parameters[i], &runs[i], angle[i], rate[i]);
    if (failed) {
      return i + failed;
    }
    i += side_by_side > 0 ? side_by_side : 1;
  }
  return 0;
}

double vwt_no_clock(void) { return 0; }

void vwt_evaluate(int size, const double* code, int count, const vwt_program_input* in, double* out) {
  const vwt_program program = {code, size};
  for (int i = 0; i < count; i++) {
    out[i] = vwt_program_value(&program, &in[i]);
  }
}

void vwt_backlash(int count, const double* in, double half, double start, double* out) {
  double at = start;
  for (int i = 0; i < count; i++) {
    if (in[i] - half > at) {
      at = in[i] - half;
    } else if (in[i] + half < at) {
      at = in[i] + half;
    }
    out[i] = at;
  }
}
