// The program of a moment for runs side by side: each operation for all lanes at once.

#include <math.h>

#include "expression.h"
#include "lanes.h"

// Of x > 0 by arithmetic; elsewhere by the library, with its signs and its values that are not finite. Only the lanes
// that are runs count.
INLINE Lane power_of_any(int count, Lane x, Lane n) {
  const Lane one = (Lane){0} + 1;
  Lane out = exponential(n * logarithm(choose(x > 0, x, one)));
  for (int k = 0; k < count; k++) {
    if (!(x[k] > 0)) {
      out[k] = pow(x[k], n[k]);
    }
  }
  return out;
}

INLINE Lane logarithm_of_any(int count, Lane x) {
  const Lane one = (Lane){0} + 1;
  Lane out = logarithm(choose(x > 0, x, one));
  for (int k = 0; k < count; k++) {
    if (!(x[k] > 0)) {
      out[k] = log(x[k]);
    }
  }
  return out;
}

INLINE Lane by_library(int count, double (*function)(double), Lane x) {
  for (int k = 0; k < count; k++) {
    x[k] = function(x[k]);
  }
  return x;
}

// The wind's speed at a time, m/s.
INLINE Lane speed_at(const Runs* c, Lane time) {
  for (int k = 0; k < VWT_LANES; k++) {
    time[k] = wind_at(c->run[k], time[k]);
  }
  return time;
}

CLONED void vwt_program_lanes(const Runs* c, const Lane* time, const Lane* angle, const Lane* rate, Lane* value) {
  const Lane none = {0}, one = none + 1;
  const double* code = c->run[0]->program;
  const int count = (int)c->run[0]->program_count;
  Lane stack[VWT_STACK];
  Lane* top = stack;  // above the last value
  for (int i = 0; i < count; i++) {
    const int operation = (int)code[i];
    top += 1 - vwt_operation_taken[operation];
    Lane* a = top - 1;  // first operand and result; the second operand is a[1]
    switch (operation) {
      case VWT_OPERATION_number:
        i++;
        for (int k = 0; k < VWT_LANES; k++) {
          (*a)[k] = c->run[k]->program[i];
        }
        break;
      case VWT_OPERATION_angle: *a = *angle; break;
      case VWT_OPERATION_rate: *a = *rate; break;
      case VWT_OPERATION_time: *a = *time; break;
      case VWT_OPERATION_speed: *a = speed_at(c, *time); break;
      case VWT_OPERATION_add: *a += a[1]; break;
      case VWT_OPERATION_subtract: *a -= a[1]; break;
      case VWT_OPERATION_multiply: *a *= a[1]; break;
      case VWT_OPERATION_divide: *a /= a[1]; break;
      case VWT_OPERATION_power: *a = power_of_any(c->count, *a, a[1]); break;
      case VWT_OPERATION_min: *a = choose((*a < a[1]) | (a[1] != a[1]), *a, a[1]); break;
      case VWT_OPERATION_max: *a = choose((*a > a[1]) | (a[1] != a[1]), *a, a[1]); break;
      case VWT_OPERATION_negative: *a = -*a; break;
      case VWT_OPERATION_square: *a *= *a; break;
      case VWT_OPERATION_cube: *a = *a * *a * *a; break;
      case VWT_OPERATION_abs: *a = size_of(*a); break;
      case VWT_OPERATION_sign: *a = choose(*a > 0, one, choose(*a < 0, -one, *a)); break;  // NaN stays
      case VWT_OPERATION_sqrt: *a = by_library(c->count, sqrt, *a); break;
      case VWT_OPERATION_exp: *a = exponential(*a); break;
      case VWT_OPERATION_log: *a = logarithm_of_any(c->count, *a); break;
      case VWT_OPERATION_sin: *a = sine(*a); break;
      case VWT_OPERATION_cos: *a = cosine(*a); break;
      case VWT_OPERATION_tan: *a = by_library(c->count, tan, *a); break;
      case VWT_OPERATION_tanh: *a = hyperbolic_tangent(*a); break;
      case VWT_OPERATION_atan: *a = by_library(c->count, atan, *a); break;
      default: *a = none / none; break;  // none: vwt_is_plain
    }
  }
  *value = stack[0];
}
