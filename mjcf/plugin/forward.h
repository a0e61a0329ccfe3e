// A forward integrator of the moment law without MuJoCo: for fits that need thousands of runs.
//
// It is RK4 with the plugin's own treatment of the lag, and with located reversals under Coulomb friction.
// Checked against the MuJoCo model for every effect; reported results come from the MuJoCo model.

#ifndef VWT_FORWARD_H_
#define VWT_FORWARD_H_

#include "moment.h"

#ifdef _WIN32
#define VWT_API __declspec(dllexport)
#else
#define VWT_API __attribute__((visibility("default")))
#endif

// A run apart from its moment law. All fields are eight bytes wide: Python fills an array of this layout.
typedef struct {
  const double* wind;     // m/s, wind_count samples at wind_interval s
  double wind_count;
  double wind_interval;
  const double* forcing;  // 1, forcing_count samples at forcing_interval s; count 0: none
  double forcing_count;
  double forcing_interval;
  double angle, rate;     // of the spring's end at time 0, rad and rad/s
  double twist, twist_rate;  // of the body against it
  double lagged;          // lag state, rad
  double twist_stiffness; // N m/rad; 0: the rod is rigid
  double twist_damping;   // N m s/rad
  double inertia_share;   // of Izz at the spring's end
  double step;            // s
  double steps;           // number of steps between samples
  double samples;         // number of samples, the first at time 0
} vwt_run;

// Fills angle and rate (of the spring's end, `samples` each) for `count` runs.
// Returns 0, or 1 + the index of the first run that left the finite range.
VWT_API int vwt_forward(int count, const vwt_parameters* parameters, const vwt_run* runs, double* const* angle,
                        double* const* rate);

// Reading behind a backlash of half width `half`: moves only when pushed. In and out may be the same.
VWT_API void vwt_backlash(int count, const double* in, double half, double start, double* out);

VWT_API int vwt_parameter_count(void);
VWT_API const char* vwt_parameter_name(int index);
VWT_API const char* vwt_parameter_unit(int index);

#endif  // VWT_FORWARD_H_
