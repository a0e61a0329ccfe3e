// A moment stated as an expression: a short program that the moment law evaluates (docs/decisions/0006).
//
// A program is an array of doubles in postfix order. Every element is the number of an operation; the operation
// `number` is followed by its value. MuJoCo keeps it in a <numeric>, as it keeps coefficients.

#ifndef VWT_EXPRESSION_H_
#define VWT_EXPRESSION_H_

// Every operation: name, number of values it takes from the stack. Each puts one value on it.
#define VWT_OPERATIONS(X)                                       \
  X(number, 0)                                                  \
  X(angle, 0) /* rad, of the rod's upper end */                 \
  X(rate, 0)  /* rad/s */                                       \
  X(time, 0)  /* s since the start of the run */                \
  X(speed, 0) /* m/s, of the wind at this time */               \
  X(add, 2) X(subtract, 2) X(multiply, 2) X(divide, 2) X(power, 2) X(min, 2) X(max, 2) \
  X(negative, 1) X(square, 1) X(cube, 1) X(abs, 1) X(sign, 1) X(sqrt, 1) X(exp, 1) X(log, 1) \
  X(sin, 1) X(cos, 1) X(tan, 1) X(tanh, 1) X(atan, 1)

enum {
#define X(name, taken) VWT_OPERATION_##name,
  VWT_OPERATIONS(X)
#undef X
  VWT_OPERATION_COUNT
};

enum { VWT_STACK = 32 };  // values that a program may hold at once

extern const char* const vwt_operation_names[VWT_OPERATION_COUNT];
extern const int vwt_operation_taken[VWT_OPERATION_COUNT];

typedef struct {
  const double* code;
  int count;  // 0: no moment
} vwt_program;

typedef struct {
  double angle, rate, time, speed;
} vwt_program_input;

// Whether a program leaves exactly one value, for any input.
int vwt_program_sound(const vwt_program* program);

// Whether two programs have the same operations; their numbers may differ.
int vwt_programs_alike(const vwt_program* one, const vwt_program* other);

// Value of a program, N m; zero where it is empty. Not a number where the program is malformed: it is checked while
// it runs, because the numerics of a MuJoCo model may be changed after loading.
double vwt_program_value(const vwt_program* program, const vwt_program_input* in);

#endif  // VWT_EXPRESSION_H_
