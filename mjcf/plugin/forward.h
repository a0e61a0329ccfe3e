// A forward integrator of the moment law without MuJoCo, for fits that need thousands of runs.
//
// It uses RK4, treats the lag as the plugin does, and locates reversals under Coulomb friction. Tests compare it with
// the MuJoCo model for every effect; reported results come from the MuJoCo model.

#ifndef VWT_FORWARD_H_
#define VWT_FORWARD_H_

#include "expression.h"
#include "parameters.h"
#include "run.h"

#ifdef _WIN32
#define VWT_API __declspec(dllexport)
#else
#define VWT_API __attribute__((visibility("default")))
#endif

// Fills angle and rate of the rod's upper end (`samples` each) for `count` runs.
// Returns 0, or 1 + the index of the first run whose motion grew without bound.
VWT_API int vwt_forward(int count, const vwt_parameters* parameters, const vwt_run* runs, double* const* angle,
                        double* const* rate);

// The terms of a plain run's acceleration, each a factor times a function of the motion, the parameters that such a
// function has, and the run's start. A term's factor is per unit inertia, and in a wind of samples the air's are per
// (m/s)2 or m/s of it. The derivatives of a motion are by these; those by anything else follow from the derivatives of
// these by it (`vwt_terms`).
#define VWT_TERMS(X)                                                                   \
  X(angle)                 /* 1/s2, of -angle: springs, and an air without a lag in a constant wind */ \
  X(rate)                  /* 1/s, of -rate */                                         \
  X(seen)                  /* 1/s2, of the angle that air sees with a lag or in a wind of samples */ \
  X(air_rate)              /* of the rate, in a wind of samples */                     \
  X(steepening)            /* of that angle's power */                                 \
  X(thickening)            /* of the rate times the angle's power */                   \
  X(rate_power)                                                                       \
  X(cube)                                                                             \
  X(square)                                                                           \
  X(play)                  /* 1/s2, of the part of the angle within the free play */   \
  X(constant)              /* 1/s2 */                                                  \
  X(drive)                 /* of its input */                                          \
  X(gravity_sine)                                                                     \
  X(gravity_cosine)                                                                   \
  X(friction)                                                                         \
  X(shedding_sine)                                                                    \
  X(shedding_cosine)                                                                  \
  X(steepening_exponent)                                                              \
  X(thickening_exponent)                                                              \
  X(rate_exponent)                                                                    \
  X(cube_exponent)                                                                    \
  X(square_exponent)                                                                  \
  X(gap)                   /* rad, of the free play */                                 \
  X(friction_exponent)                                                                \
  X(friction_saturation)   /* rad/s, that acts */                                      \
  X(friction_peak_rate)    /* rad/s, that acts */                                      \
  X(friction_peak)                                                                    \
  X(friction_load)                                                                    \
  X(lag)                   /* s */                                                     \
  X(turn)                  /* rad/s, of the shedding */                                \
  X(pace)                  /* ln of the step in s; by it the motion of the law itself */ \
  X(start_angle)           /* rad */                                                   \
  X(start_rate)            /* rad/s */                                                 \
  X(start_lagged)          /* rad */

enum {
#define X(name) VWT_TERM_##name,
  VWT_TERMS(X)
#undef X
  VWT_TERM_COUNT
};
enum { VWT_MOST_CHANGES = 8 };  // of the samples of a wind or a drive, by which there are derivatives

// Values of all terms of `count` plain runs, shape (count, VWT_TERM_COUNT).
VWT_API void vwt_terms(int count, const vwt_parameters* parameters, const vwt_run* runs, double* values);

// As `vwt_forward`, for plain runs: also the derivatives of angle and rate by the terms in `columns`, `width` of them,
// shape (width, size) by run, of which a run sets its first samples. The column VWT_TERM_COUNT + k is along a change of the run's samples: the k-th row of
// its `changes`, at most VWT_MOST_CHANGES. A row holds a change of the wind, m/s, shape (wind_count,), or of the drive,
// its samples before their slopes, shape (2, moment_count). With weights of the ends of an interval between
// samples, by run, shape (4, weighed) for its first and last angle and its first and last rate, the derivatives are
// those of the weighted sums instead, shape (width, size - 1), in `angle_slopes`; one weight of each kind serves all
// intervals. A derivative that does not exist is NaN throughout. Returns -1 where a run is not plain, its rod
// twists, it has a moment by expression, or its friction is a root of the rate, depends on the load or is Dahl's.
VWT_API int vwt_slopes(int count, const vwt_parameters* parameters, const vwt_run* runs, int size, int width,
                       const int* columns, const double* const* changes, const double* const* weights, int weighed,
                       double* const* angle, double* const* rate, double* const* angle_slopes,
                       double* const* rate_slopes);

// Reading behind a backlash of half width `half`: it moves only when pushed. `in` and `out` may be the same array.
VWT_API void vwt_backlash(int count, const double* in, double half, double start, double* out);

// Always 0, s: a clock for MuJoCo's timers, which read theirs about fifty times in a step.
VWT_API double vwt_no_clock(void);

// Values of a program for `count` inputs, N m.
VWT_API void vwt_evaluate(int size, const double* code, int count, const vwt_program_input* in, double* out);

// Names of the law's parameters, the plugin's state variables, the operations of a program and the fields of vwt_run,
// for callers in Python.
VWT_API int vwt_parameter_count(void);
VWT_API const char* vwt_parameter_name(int index);
VWT_API const char* vwt_parameter_unit(int index);
VWT_API int vwt_state_count(void);
VWT_API const char* vwt_state_name(int index);
VWT_API int vwt_operation_count(void);
VWT_API const char* vwt_operation_name(int index);
VWT_API int vwt_term_count(void);
VWT_API const char* vwt_term_name(int index);
VWT_API int vwt_most_changes(void);
VWT_API int vwt_run_size(void);  // bytes
VWT_API int vwt_run_count(void);
VWT_API const char* vwt_run_name(int index);
VWT_API int vwt_run_offset(int index);      // bytes from the start
VWT_API int vwt_run_is_pointer(int index);  // 1, or 0 where it is a number

#endif  // VWT_FORWARD_H_
