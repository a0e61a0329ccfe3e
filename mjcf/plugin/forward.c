#include "forward.h"

#include "plain.h"
#include "single.h"

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
                           : vwt_integrate_alone(&parameters[i], &runs[i], angle[i], rate[i]);
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
