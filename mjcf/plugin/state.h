// The plugin's state: the motion at the start of the present step, needed in its stages for lag and friction.

#ifndef VWT_STATE_H_
#define VWT_STATE_H_

// All variables in order. All zero: the run has not started.
#define VWT_STATE(X)                                          \
  X(lagged)     /* rad, the lag's state x */                  \
  X(angle)      /* rad, of the rod's upper end */             \
  X(rate)       /* rad/s */                                   \
  X(twist)      /* rad, of the body relative to the upper end */ \
  X(twist_rate) /* rad/s */                                   \
  X(time)       /* s */                                       \
  X(started)    /* 1 once the variables above are set */      \
  X(deflection) /* rad, Dahl's state z */

typedef struct {
#define X(name) double name;
  VWT_STATE(X)
#undef X
} vwt_state;

enum { VWT_STATE_COUNT = sizeof(vwt_state) / sizeof(double) };

#endif  // VWT_STATE_H_
