// A run by itself: it reverses or sticks within a step, or its drive has a kink there (single.c). No width enters here.

#ifndef VWT_SINGLE_H_
#define VWT_SINGLE_H_

#include "lag.h"
#include "parameters.h"
#include "run.h"

// A stretch of a step with Coulomb friction in which the slip keeps its sign, from its start on.
typedef struct {
  double start, duration, angle, rate, lagged;
  int slip;
  double kept;  // of a small change of the rate, after the reversal that ends the stretch; 1 where none does
} Stretch;

enum { VWT_MOST_STRETCHES = 10 };

// How a step with Coulomb friction went.
typedef struct {
  int count;
  Stretch stretch[VWT_MOST_STRETCHES];
} Passage;

// The start of a step: the numbers of a `State`, in its order.
typedef struct {
  double start, angle, rate, twist, twist_rate, lagged, slip, deflection;
} vwt_point;

// What a run keeps from one step by itself to the next.
typedef struct {
  int begun, sample;  // of the drive: the last sample reached, where `begun`
  int rests;          // for good
  vwt_lag half, whole;
  Passage* passage;   // where the stretches of a step are noted; NULL: nowhere
} Alone;

// A step of length h with Coulomb friction. Where it changes nothing in a steady law, the run rests for good.
void vwt_step_alone(const vwt_parameters* p, const vwt_run* run, double h, vwt_point* at, Alone* alone);

// Fills angle and rate of any run. Returns as `vwt_forward`.
int vwt_integrate_alone(const vwt_parameters* p, const vwt_run* run, double* angle, double* rate);

#endif  // VWT_SINGLE_H_
