// The parameters of the moment law.

#ifndef VWT_PARAMETERS_H_
#define VWT_PARAMETERS_H_

#ifdef __cplusplus
extern "C" {
#endif

// Every parameter of the law: name, unit, least value allowed. A missing parameter is zero; a term whose coefficient
// is zero vanishes exactly; an exponent of zero selects the textbook power. The names are those of the
// <custom><numeric> elements of the MJCF.
#define VWT_PARAMETERS(X)                        \
  /* the flow and the model's reference sizes */ \
  X(air_density, "kg/m3", 0)                     \
  X(frontal_area, "m2", 0)                       \
  X(reference_length, "m", 0)                    \
  X(width, "m", 0)                               \
  /* the aerodynamic moment */                   \
  X(cn_beta, "1/rad", -VWT_ANY)                  \
  X(cn_r, "1/rad", -VWT_ANY)                     \
  X(moment_cubic, "1/rad2", -VWT_ANY)            \
  X(moment_cubic_exponent, "1", 0)               \
  X(damping_quadratic, "1/rad2", -VWT_ANY)       \
  X(damping_quadratic_exponent, "1", 0)          \
  X(aero_lag, "l/V", -VWT_ANY)                   \
  X(flow_angle, "rad", -VWT_ANY)                 \
  X(shedding_amplitude, "1", -VWT_ANY)           \
  X(strouhal_number, "1", 0)                     \
  X(shedding_phase, "rad", -VWT_ANY)             \
  /* the mechanism */                            \
  X(friction_moment, "N m", 0)                   \
  X(presliding, "rad", 0)                        \
  X(friction_exponent, "1", 0)                   \
  X(friction_saturation, "rad/s", 0)             \
  X(friction_peak, "1", 0)                       \
  X(friction_peak_rate, "rad/s", 0)              \
  X(friction_load, "1", 0)                       \
  X(load_stiffness, "N m/rad", -VWT_ANY)         \
  X(load_angle, "rad", -VWT_ANY)                 \
  X(quadratic_damping, "N m s2/rad2", -VWT_ANY)  \
  X(quadratic_damping_exponent, "1", 0)          \
  X(loss_factor, "1", -VWT_ANY)                  \
  X(stiffness_cubic, "1/rad2", -VWT_ANY)         \
  X(stiffness_cubic_exponent, "1", 0)            \
  X(stiffness_quadratic, "1/rad", -VWT_ANY)      \
  X(stiffness_quadratic_exponent, "1", 0)        \
  X(free_play, "rad", 0)                         \
  X(gravity_stiffness, "N m/rad", -VWT_ANY)      \
  X(gravity_angle, "rad", -VWT_ANY)              \
  /* attributes of joint and body in MuJoCo */   \
  X(spring_stiffness, "N m/rad", 0)              \
  X(mechanical_damping, "N m s/rad", 0)          \
  X(yaw_inertia, "kg m2", 0)

#define VWT_ANY 1e300

typedef struct {
#define X(name, unit, least) double name;
  VWT_PARAMETERS(X)
#undef X
} vwt_parameters;

enum {
#define X(name, unit, least) VWT_INDEX_##name,
  VWT_PARAMETERS(X)
#undef X
  VWT_PARAMETER_COUNT
};

extern const char* const vwt_parameter_names[VWT_PARAMETER_COUNT];
extern const char* const vwt_parameter_units[VWT_PARAMETER_COUNT];
extern const double vwt_parameter_least[VWT_PARAMETER_COUNT];

// Where a power with a free exponent equals that of the textbook.
#define VWT_ANGLE_REFERENCE 0.2  // rad
#define VWT_RATE_REFERENCE 2.0   // rad/s

#ifdef __cplusplus
}
#endif
#endif  // VWT_PARAMETERS_H_
