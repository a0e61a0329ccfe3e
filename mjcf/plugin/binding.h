// The moment law applied to MuJoCo's model and data. Coefficients are stored in <custom><numeric> and read at every
// call, because mujoco.rollout and mujoco.batch reuse one mjData for many models.

#ifndef VWT_BINDING_H_
#define VWT_BINDING_H_

#include <mujoco/mujoco.h>

#include "instance.h"
#include "state.h"

// Adds the moments of air and mechanism to qfrc_passive.
void vwt_apply_moments(const mjModel* m, mjData* d, vwt_instance* instance, const vwt_state* state);

// Writes the aerodynamic moment on the body, N m, to the sensors of the instance.
void vwt_sense_moment(const mjModel* m, mjData* d, const vwt_ids* self, const vwt_state* state, int instance);

// Advances the state from the start of a step to its end.
void vwt_end_step(const mjModel* m, const mjData* d, const vwt_ids* self, vwt_state* state);

#endif  // VWT_BINDING_H_
