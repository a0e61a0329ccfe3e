// A run as the integrators take it.

#ifndef VWT_RUN_H_
#define VWT_RUN_H_

// A run without its moment law: pointers to samples, and numbers.
#define VWT_RUN(POINTER, NUMBER)                                                    \
  POINTER(wind)            /* m/s, wind_count samples at wind_interval s */         \
  NUMBER(wind_count)                                                                \
  NUMBER(wind_interval)                                                             \
  POINTER(forcing)         /* 1, forcing_count samples at forcing_interval s */     \
  NUMBER(forcing_count)    /* 0: none */                                            \
  NUMBER(forcing_interval)                                                          \
  POINTER(ambient)         /* N m, ambient_count samples at ambient_interval s */   \
  NUMBER(ambient_count)    /* 0: none */                                            \
  NUMBER(ambient_interval)                                                          \
  POINTER(moment)          /* of the drive: moment_count samples, any unit */       \
  POINTER(moment_time)     /* s, of these samples, increasing */                    \
  NUMBER(moment_count)     /* 0: none */                                            \
  NUMBER(moment_scale)     /* N m per unit */                                       \
  NUMBER(moment_delay)     /* s, by which the drive acts later than its samples */  \
  NUMBER(moment_held)      /* 1: constant from one sample to the next; 0: linear */ \
  POINTER(moment_slope)    /* per s, of the line from each sample on; null: as `moment_held` says */ \
  NUMBER(moment_on_end)    /* 1: moves the spring's root; 0: acts on the body */    \
  NUMBER(moment_offset)    /* N m, a constant moment beside the samples */          \
  NUMBER(moment_interval)  /* s, between samples with slopes, each at the start of a step */ \
  POINTER(program)         /* of the moment by expression, program_count elements */ \
  NUMBER(program_count)    /* 0: none */                                            \
  NUMBER(angle)            /* rad, of the rod's upper end at time 0 */              \
  NUMBER(rate)             /* rad/s */                                              \
  NUMBER(twist)            /* rad, of the body relative to the upper end */         \
  NUMBER(twist_rate)       /* rad/s */                                              \
  NUMBER(lagged)           /* rad, the lag's state */                               \
  NUMBER(twist_stiffness)  /* N m/rad; 0: the rod is rigid */                       \
  NUMBER(twist_damping)    /* N m s/rad */                                          \
  NUMBER(inertia_share)    /* of Izz at the rod's upper end */                      \
  NUMBER(lead)             /* rigid rod: of the body before the upper end, a share */ \
  NUMBER(rod_stiffness)    /* rigid rod: added to the spring's, N m/rad */          \
  NUMBER(step)             /* s */                                                  \
  NUMBER(steps)            /* between samples */                                    \
  NUMBER(stride)           /* samples that one step covers, where steps is 1; 0: one */ \
  NUMBER(samples)          /* the first at time 0 */

typedef struct {
#define POINTER(name) const double* name;
#define NUMBER(name) double name;
  VWT_RUN(POINTER, NUMBER)
#undef POINTER
#undef NUMBER
} vwt_run;

#endif  // VWT_RUN_H_
