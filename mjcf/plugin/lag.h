// The aerodynamic lag: its time constant, and its state after a step.

#ifndef VWT_LAG_H_
#define VWT_LAG_H_

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

// Time constant of the aerodynamic lag, s (a l/V); 0 without lag, negative for a phase lead.
double vwt_lag_time(const vwt_parameters* p, double wind_speed);

// Lag state after `duration` s, from `lagged`, while the angle follows the cubic from (angle0, rate0) to
// (angle1, rate1). Exact for such a path.
double vwt_lag_advance(double lag_time, double lagged, double duration, double angle0, double rate0,
                       double angle1, double rate1);

// The same in two parts, for steps of equal length: the lag over a duration, and the state with its weights.
typedef struct {
  double time, ratio, w[4];  // s, 0 without a lag; duration/|time|, on which the weights depend; all 0: to be set
} vwt_lag;

void vwt_set_lag(vwt_lag* lag, double time, double duration);
void vwt_lag_weight_slopes(const vwt_lag* lag, double slopes[4]);  // by the ratio
double vwt_lag_weighted(const double w[4], double lagged, double duration, double angle0, double rate0,
                        double angle1, double rate1);

#ifdef __cplusplus
}
#endif
#endif  // VWT_LAG_H_
