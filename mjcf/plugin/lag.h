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

// The same in two parts, for steps of equal length: weights from duration/|lag_time| > 0, and the state with them.
void vwt_lag_weights(double z, double w[4]);
void vwt_lag_weight_slopes(double z, const double w[4], double slopes[4]);  // by z
double vwt_lag_weighted(const double w[4], double lagged, double duration, double angle0, double rate0,
                        double angle1, double rate1);

#ifdef __cplusplus
}
#endif
#endif  // VWT_LAG_H_
