#include "lag.h"

#include <math.h>

double vwt_lag_time(const vwt_parameters* p, double wind_speed) {
  return wind_speed > 0 ? p->aero_lag * p->reference_length / wind_speed : 0;
}

// Moments of the lag's kernel, w[n] = integral of z exp(-z (1 - u)) u^n over u from 0 to 1, n = 0..3.
// Integration by parts gives w[n] = 1 - n w[n-1]/z. The recursion runs upwards for large z, and downwards from a
// series for small z, so that no digits are lost for any step.
static void set_weights(double z, double w[4]) {
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

void vwt_set_lag(vwt_lag* lag, double time, double duration) {
  const double ratio = time != 0 && duration > 0 ? duration / fabs(time) : 0;
  lag->time = time;
  if (ratio != lag->ratio) {
    lag->ratio = ratio;
    set_weights(ratio, lag->w);
  }
}

// dw[n]/dz, from the same series and recursions.
void vwt_lag_weight_slopes(const vwt_lag* lag, double slopes[4]) {
  const double z = lag->ratio, *w = lag->w;
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
  vwt_lag lag = {0};
  vwt_set_lag(&lag, lag_time, duration);
  return lag_time == 0 ? angle1 : vwt_lag_weighted(lag.w, lagged, duration, angle0, rate0, angle1, rate1);
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
