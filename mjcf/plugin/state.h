// The plugin's state: where the present step started. Its stages read it for the lag and for friction.

#ifndef VWT_STATE_H_
#define VWT_STATE_H_

// Every number in its order. All zero means: not started.
#define VWT_STATE(X)                                          \
  X(lagged)     /* rad, the lag's state x */                  \
  X(angle)      /* rad, of the spring's end of the rod */     \
  X(rate)       /* rad/s */                                   \
  X(twist)      /* rad, of the body against the spring's end */ \
  X(twist_rate) /* rad/s */                                   \
  X(time)       /* s */                                       \
  X(started)    /* 1 once the numbers above hold */           \
  X(deflection) /* rad, Dahl's state z */

typedef struct {
#define X(name) double name;
  VWT_STATE(X)
#undef X
} vwt_state;

enum { VWT_STATE_COUNT = sizeof(vwt_state) / sizeof(double) };

#endif  // VWT_STATE_H_
