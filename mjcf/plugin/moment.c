#include "moment.h"

#include <math.h>

#include "law.h"

double vwt_air_moment(const vwt_parameters* p, const vwt_air_state* s) {
  if (!(s->wind_speed > 0)) {
    return 0;
  }
  Coefficients c;
  Air air;
  Wake wake;
  Powers powers;
  set_coefficients(&c, 0, p);
  set_air(&air, 0, p, s->wind_speed);
  set_wake(&wake, 0, p, s->wind_speed);
  const double shed = shed_at(&c, &wake, s->time), forcing = flow_at(p, s->wind_speed) * s->wind_speed * s->forcing;
  return moment_of_air(&c, &air, &wake, ANY, s->angle, s->rate, shed, s->lagged, &powers) + forcing;
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

double vwt_presliding_advance(double range, double deflection, double duration, double angle0, double rate0,
                              double angle1, double rate1) {
  return deflection_after(range, deflection, duration, angle0, rate0, angle1, rate1);
}
