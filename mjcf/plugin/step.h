// The state of one run within a step of the forward integrator, which forward.c and lanes.c share (step.c).

#ifndef VWT_STEP_H_
#define VWT_STEP_H_

#include "parameters.h"
#include "run.h"

typedef struct {
  double angle, rate, twist, twist_rate;
} Motion;

// Weights of the lag's advance over the two lengths that a step of the Runge-Kutta method uses.
typedef struct {
  double z[2], w[2][4];
  int last;
} LagWeights;

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

// The quantities that are constant during a step: the law, the run, and the step's start for lag and friction.
typedef struct {
  const vwt_parameters* p;
  const vwt_run* run;
  double start;        // time of the step's start, s
  Motion from;         // motion there
  double lagged;       // lag state there
  int slip;            // sign of the slip under Coulomb friction; 0: at rest
  double least_rate;   // over which the friction changes, rad/s
  double range;        // of Dahl's friction, rad; 0: none
  double deflection;   // Dahl's state at the start, rad
  LagWeights* weights;
  int sample;          // of the drive, at the step's start; -1 before the first
  double moment, moment_slope, moment_from;  // of the drive, N m and N m/s, linear in time from there on
  Passage* passage;    // where the stretches of a step with friction are noted; NULL: nowhere
} Step;

// The run at its start.
Step vwt_release(const vwt_parameters* p, const vwt_run* run, LagWeights* weights);

// The drive from the step's start on. Returns the time of its next sample, s, or infinity after the last.
double vwt_set_drive(Step* s);

// One step without Coulomb friction.
void vwt_step(Step* s, double h);

// One step with Coulomb friction: it ends early at each reversal, where the body sticks or slips back.
void vwt_step_with_friction(Step* s, double h);

// Samples within a step of length h that covers `stride` of them, from sample `at` on; cubic (Hermite).
void vwt_fill(const Motion* from, const Motion* to, double h, int stride, int at, int samples, double* angle,
              double* rate);

#endif  // VWT_STEP_H_
