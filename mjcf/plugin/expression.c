#include "expression.h"

#include <math.h>

#define X(name, taken) #name,
const char* const vwt_operation_names[VWT_OPERATION_COUNT] = {VWT_OPERATIONS(X)};
#undef X
#define X(name, taken) taken,
const int vwt_operation_taken[VWT_OPERATION_COUNT] = {VWT_OPERATIONS(X)};
#undef X

// The operation at an element of the code; -1 where there is none.
static int operation_at(const double* code, int i) {
  return code[i] >= 0 && code[i] < VWT_OPERATION_COUNT ? (int)code[i] : -1;
}

int vwt_program_sound(const vwt_program* program) {
  int height = 0;
  for (int i = 0; i < program->count; i++) {
    const int operation = operation_at(program->code, i);
    if (operation < 0 || height < vwt_operation_taken[operation] || height - vwt_operation_taken[operation] >= VWT_STACK) {
      return 0;
    }
    height += 1 - vwt_operation_taken[operation];
    i += operation == VWT_OPERATION_number;
    if (i == program->count) {
      return 0;
    }
  }
  return height == 1;
}

int vwt_programs_alike(const vwt_program* one, const vwt_program* other) {
  if (one->count != other->count) {
    return 0;
  }
  for (int i = 0; i < one->count; i++) {
    if (one->code[i] != other->code[i]) {
      return 0;
    }
    i += one->code[i] == VWT_OPERATION_number;
  }
  return 1;
}

double vwt_program_value(const vwt_program* program, const vwt_program_input* in) {
  if (program->count == 0) {
    return 0;
  }
  double stack[VWT_STACK];
  int height = 0;
  for (int i = 0; i < program->count; i++) {
    const int operation = operation_at(program->code, i);
    if (operation < 0) {
      return NAN;
    }
    const int taken = vwt_operation_taken[operation];
    if (height < taken || height - taken >= VWT_STACK) {
      return NAN;
    }
    double* a = &stack[height - taken];  // first operand and result; the second operand is a[1]
    height += 1 - taken;
    switch (operation) {
      case VWT_OPERATION_number:
        if (++i == program->count) {
          return NAN;
        }
        a[0] = program->code[i];
        break;
      case VWT_OPERATION_angle: a[0] = in->angle; break;
      case VWT_OPERATION_rate: a[0] = in->rate; break;
      case VWT_OPERATION_time: a[0] = in->time; break;
      case VWT_OPERATION_speed: a[0] = in->speed; break;
      case VWT_OPERATION_add: a[0] += a[1]; break;
      case VWT_OPERATION_subtract: a[0] -= a[1]; break;
      case VWT_OPERATION_multiply: a[0] *= a[1]; break;
      case VWT_OPERATION_divide: a[0] /= a[1]; break;
      case VWT_OPERATION_power: a[0] = pow(a[0], a[1]); break;
      case VWT_OPERATION_min: a[0] = fmin(a[0], a[1]); break;
      case VWT_OPERATION_max: a[0] = fmax(a[0], a[1]); break;
      case VWT_OPERATION_negative: a[0] = -a[0]; break;
      case VWT_OPERATION_square: a[0] *= a[0]; break;
      case VWT_OPERATION_cube: a[0] = a[0] * a[0] * a[0]; break;
      case VWT_OPERATION_abs: a[0] = fabs(a[0]); break;
      case VWT_OPERATION_sign: a[0] = a[0] > 0 ? 1 : a[0] < 0 ? -1 : a[0]; break;  // NaN stays
      case VWT_OPERATION_sqrt: a[0] = sqrt(a[0]); break;
      case VWT_OPERATION_exp: a[0] = exp(a[0]); break;
      case VWT_OPERATION_log: a[0] = log(a[0]); break;
      case VWT_OPERATION_sin: a[0] = sin(a[0]); break;
      case VWT_OPERATION_cos: a[0] = cos(a[0]); break;
      case VWT_OPERATION_tan: a[0] = tan(a[0]); break;
      case VWT_OPERATION_tanh: a[0] = tanh(a[0]); break;
      case VWT_OPERATION_atan: a[0] = atan(a[0]); break;
      default: return NAN;
    }
  }
  return height == 1 ? stack[0] : NAN;
}
