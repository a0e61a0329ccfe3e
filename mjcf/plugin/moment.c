#include "moment.h"

#include <math.h>

#include "law.h"

#define X(name, unit, least) #name,
const char* const vwt_parameter_names[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X
#define X(name, unit, least) unit,
const char* const vwt_parameter_units[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X
#define X(name, unit, least) least,
const double vwt_parameter_least[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X

double vwt_lag_time(const vwt_parameters* p, double wind_speed) {
  return wind_speed > 0 ? p->aero_lag * p->reference_length / wind_speed : 0;
}

double vwt_air_moment(const vwt_parameters* p, const vwt_air_state* s) {
  if (!(s->wind_speed > 0)) {
    return 0;
  }
  Coefficients c;
  Air air;
  Powers powers;
  set_coefficients(&c, 0, p);
  set_wake(&c, 0, p, s->wind_speed);
  set_air(&air, 0, p, s->wind_speed);
  const double shed = shed_at(&c, s->time), forcing = flow_at(p, s->wind_speed) * s->wind_speed * s->forcing;
  return moment_of_air(&c, &air, ANY, s->angle, s->rate, shed, s->lagged, &powers) + forcing;
}

double vwt_mechanism_moment(const vwt_parameters* p, double angle, double deflection, double rate) {
  Coefficients c;
  Powers powers;
  set_coefficients(&c, 0, p);
  return moment_of_mechanism(&c, ANY, angle, deflection, rate, &powers);
}

double vwt_load(const vwt_parameters* p, double angle, double drive) {
  if (p->friction_load == 0) {
    return 0;
  }
  const double gravity = p->gravity_stiffness * sine(angle - p->gravity_angle);
  return fmax(fabs(gravity + p->load_stiffness * sine(angle - p->load_angle)), fabs(drive));
}

double vwt_friction_level(const vwt_parameters* p, double least, double along, double load) {
  Friction f;
  set_friction(&f, 0, p, least);
  return friction_level(&f, ANY, along, load);
}

// Under the greatest load of gravity.
static double greatest_friction(const vwt_parameters* p) {
  return p->friction_moment + p->friction_load * (fabs(p->gravity_stiffness) + fabs(p->load_stiffness));
}

double vwt_friction_least_rate(const vwt_parameters* p, double inertia, double duration) {
  return greatest_friction(p) * (1 + p->friction_peak) * duration / inertia;  // 1 rad in a step
}

double vwt_friction_moment(const vwt_parameters* p, double inertia, double rate, double other, double load,
                           double duration, double now, double load_now) {
  if (!vwt_rubs(p)) {
    return 0;
  }
  const double least = vwt_friction_least_rate(p, inertia, duration), limit = vwt_friction_level(p, least, 0, load);
  const double level = vwt_friction_level(p, least, fabs(now), load_now);
  if (limit == 0) {  // it vanishes where the rate does, and needs no care there
    return -copysign(level, now);
  }
  // friction after the other moments have reversed the motion
  const double onward = other > 0 ? -limit : limit;
  if (rate == 0) {
    return fabs(other) <= limit ? -other : other > 0 ? -level : level;
  }
  const double start = vwt_friction_level(p, least, fabs(rate), load);
  const double slip = rate > 0 ? -start : start;
  const double acceleration = (other + slip) / inertia;
  const double stop = -rate / acceleration;  // time at which the rate passes zero
  if (!(stop >= 0 && stop < duration)) {
    return rate > 0 ? -level : level;
  }
  if (fabs(other) <= limit) {
    return -other - inertia * rate / duration;  // sticks: the rate is zero at the end of the step
  }
  return (slip * stop + onward * (duration - stop)) / duration;
}

double vwt_presliding_range(const vwt_parameters* p, double inertia, double duration) {
  return fmax(p->presliding, greatest_friction(p) * duration * duration / (2 * inertia));  // 2 rad in a step
}

// Deflection after a motion over `distance` in the direction `side`, 1 or -1.
static double slide(double range, double deflection, int side, double distance) {
  return distance > 0 ? deflection - (side * range - deflection) * expm1(-distance / range) : deflection;
}

double vwt_presliding_advance(double range, double deflection, double duration, double angle0, double rate0,
                              double angle1, double rate1) {
  const double change = angle1 - angle0;
  const int side = rate0 > 0 || (rate0 == 0 && change > 0) ? 1 : -1;
  // The distance after the reversal is computed from the end of the step, so that the deflection is a smooth function
  // of the end point. The stages of the Runge-Kutta method, which do not lie on one path, need this.
  const double back = rate0 * rate1 < 0 ? duration * rate1 * rate1 / (2 * fabs(rate1 - rate0)) : 0;
  const double turned = slide(range, deflection, side, side * change + back);
  return slide(range, turned, -side, back);
}

// Moments of the lag's kernel, w[n] = integral of z exp(-z (1 - u)) u^n over u from 0 to 1, n = 0..3.
// Integration by parts gives w[n] = 1 - n w[n-1]/z. The recursion runs upwards for large z, and downwards from a
// series for small z, so that no digits are lost for any step.
void vwt_lag_weights(double z, double w[4]) {
  if (z > 1) {
    w[0] = -expm1(-z);
    for (int n = 1; n < 4; n++) {
      w[n] = 1 - n * w[n - 1] / z;
    }
    return;
  }
  double term = z / 4, sum = term;  // w[3] = sum of -(-z)^k 3!/(3+k)! over k from 1
  for (int k = 2; k < 16; k++) {
    term *= -z / (3 + k);
    const double before = sum;
    sum += term;
    if (sum == before) {  // the terms decrease: no later one changes a bit
      break;
    }
  }
  w[3] = sum;
  for (int n = 3; n > 0; n--) {
    w[n - 1] = z * (1 - w[n]) / n;
  }
}

// dw[n]/dz, from the same series and recursions.
void vwt_lag_weight_slopes(double z, const double w[4], double slopes[4]) {
  if (z > 1) {
    slopes[0] = exp(-z);
    for (int n = 1; n < 4; n++) {
      slopes[n] = n * (w[n - 1] / z - slopes[n - 1]) / z;
    }
    return;
  }
  double term = 0.25, sum = term;
  for (int k = 2; k < 18; k++) {
    term *= -z / (3 + k);
    sum += k * term;
  }
  slopes[3] = sum;
  for (int n = 3; n > 0; n--) {
    slopes[n - 1] = (1 - w[n] - z * slopes[n]) / n;
  }
}

double vwt_lag_advance(double lag_time, double lagged, double duration, double angle0, double rate0,
                       double angle1, double rate1) {
  if (lag_time == 0) {
    return angle1;
  }
  if (!(duration > 0)) {
    return lagged;
  }
  double w[4];
  vwt_lag_weights(duration / fabs(lag_time), w);
  return vwt_lag_weighted(w, lagged, duration, angle0, rate0, angle1, rate1);
}

double vwt_lag_weighted(const double w[4], double lagged, double duration, double angle0, double rate0,
                        double angle1, double rate1) {
  // the path as a function of u = time/duration: angle0 + c1 u + c2 u^2 + c3 u^3 (Hermite)
  const double h = duration, change = angle1 - angle0;
  const double c1 = h * rate0;
  const double c2 = 3 * change - h * (2 * rate0 + rate1);
  const double c3 = h * (rate0 + rate1) - 2 * change;
  return lagged + w[0] * (angle0 - lagged) + w[1] * c1 + w[2] * c2 + w[3] * c3;
}
