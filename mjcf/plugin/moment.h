// The moment law of the rig: all moments of air and mechanism except those of the linear spring and damper.
//
// It does not depend on MuJoCo. The engine plugin calls these functions; they and the forward integrator have the terms
// of law.h, so each is implemented once. Angles in rad; moments in N m, positive in the direction of yaw.

#ifndef VWT_MOMENT_H_
#define VWT_MOMENT_H_

#include "lag.h"
#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

// The quantities on which the aerodynamic moment depends.
typedef struct {
  double time;        // s since the start of the run
  double wind_speed;  // m/s, at this time
  double angle;       // rad, of the body
  double rate;        // rad/s, of the body
  double lagged;      // rad, the lag's state x; ignored where aero_lag or the wind is zero
  double forcing;     // 1, coefficient of an imposed aerodynamic moment (turbulence)
} vwt_air_state;

// Aerodynamic yaw moment on the body, N m.
double vwt_air_moment(const vwt_parameters* p, const vwt_air_state* s);

// Moment of the mechanism on the rod's upper end, N m, without friction and without the linear terms
// -spring_stiffness*deflection - mechanical_damping*rate. The spring's deflection is the angle less that of its root.
double vwt_mechanism_moment(const vwt_parameters* p, double angle, double deflection, double rate);

static inline int vwt_rubs(const vwt_parameters* p) { return p->friction_moment > 0 || p->friction_load > 0; }

// The moment that the joint carries, N m: the greater of gravity's and the drive's, which act on its two sides. Gravity
// is that of the law, and that of load_stiffness sin(angle - load_angle), which acts in another part of the model. 0
// where friction does not depend on it.
double vwt_load(const vwt_parameters* p, double angle, double drive);

// Moment of the friction, N m, against a slip at a rate of `along` rad/s in its own direction:
// (friction_moment + friction_load load) (along/2)^n tanh(along/v0) (1 + b exp(-(along/vs)^2)), with the exponent n, the
// saturation v0, the peak b and the peak_rate vs; a factor whose parameter is zero is one. v0 and vs are at least `least`,
// from `vwt_friction_least_rate`, so that friction does not change by more than the integration with steps of `duration` s
// follows.
double vwt_friction_level(const vwt_parameters* p, double least, double along, double load);
double vwt_friction_least_rate(const vwt_parameters* p, double inertia, double duration);

// Coulomb friction in a step of `duration` s, N m. It opposes the rate. Where the rate would pass zero within the step, it
// is the constant moment with the same impulse: friction reverses there or sticks, depending on the other moments.
// `rate`, `other`, the sum of all other moments, and `load` are taken at the start of the step, `now` and `load_now` are
// the present rate and load.
double vwt_friction_moment(const vwt_parameters* p, double inertia, double rate, double other, double load,
                           double duration, double now, double load_now);

// Range zs of Dahl's friction, rad, which replaces Coulomb friction where `presliding` is not zero:
// -friction_moment z/zs, where the deflection z follows dz = dangle - |dangle| z/zs. The range is limited from below so
// that the oscillation of the contact, of stiffness 2 friction_moment/zs, is stable with steps of `duration` s.
double vwt_presliding_range(const vwt_parameters* p, double inertia, double duration);

// Deflection after `duration` s, from `deflection`, while the angle moves from (angle0, rate0) to (angle1, rate1).
// Exact for a motion in one direction at any speed; where the rate changes sign, the reversal is placed at the angle
// given by a constant acceleration.
double vwt_presliding_advance(double range, double deflection, double duration, double angle0, double rate0,
                              double angle1, double rate1);

// Linear interpolation in `count` samples at `interval` s from time 0; constant beyond the ends.
static inline double vwt_series(const double* values, int count, double interval, double time) {
  if (count == 1 || !(time > 0)) {
    return values[0];
  }
  const double place = time / interval;
  if (!(place < count - 1)) {  // also where interval is zero or not a number
    return values[count - 1];
  }
  const int low = (int)place;
  return values[low] + (place - low) * (values[low + 1] - values[low]);
}

#ifdef __cplusplus
}
#endif
#endif  // VWT_MOMENT_H_
