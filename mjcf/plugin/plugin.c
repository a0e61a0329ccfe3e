// Callbacks of the MuJoCo engine plugin "vwt.yaw_moment": the rig's moment law as passive forces, and the aerodynamic
// moment as a sensor. Its attributes and numerics are listed in README.md.

#include <stdlib.h>
#include <string.h>

#include <mujoco/mujoco.h>

#include "binding.h"
#include "instance.h"
#include "state.h"

static vwt_state* state_of(const mjModel* m, mjData* d, int instance) {
  return (vwt_state*)(d->plugin_state + m->plugin_stateadr[instance]);
}

static int init(const mjModel* m, mjData* d, int instance) {
  d->plugin_data[instance] = 0;
  return vwt_instance_renew(m, d, instance);
}

static void destroy(mjData* d, int instance) {
  free((void*)d->plugin_data[instance]);
  d->plugin_data[instance] = 0;
}

// The destination now has arrays of this model's sizes; MuJoCo copies the state in them.
static void copy(mjData* dest, const mjModel* m, const mjData* src, int instance) {
  (void)src;
  if (vwt_instance_renew(m, dest, instance)) {
    mju_error("vwt.yaw_moment: out of memory");
  }
}

static void reset(const mjModel* m, mjtNum* plugin_state, void* plugin_data, int instance) {
  (void)instance;
  if (plugin_data) {
    vwt_check_layout(m, (const vwt_instance*)plugin_data);
    vwt_instance_release((vwt_instance*)plugin_data);
  }
  memset(plugin_state, 0, sizeof(vwt_state));
}

static void compute(const mjModel* m, mjData* d, int instance, int capability_bit) {
  // MuJoCo computes sensors once, before the first stage of a step; the later stages skip them.
  vwt_instance* self = capability_bit & mjPLUGIN_SENSOR ? vwt_instance_compared(m, d, instance)
                                                        : vwt_instance_for(m, d, instance);
  const vwt_state* state = state_of(m, d, instance);
  if (capability_bit & mjPLUGIN_PASSIVE) {
    vwt_apply_moments(m, d, self, state);
  } else if (capability_bit & mjPLUGIN_SENSOR) {
    vwt_sense_moment(m, d, &self->ids, state, instance);
  }
}

static void advance(const mjModel* m, mjData* d, int instance) {
  vwt_instance* self = vwt_instance_for(m, d, instance);
  vwt_end_step(m, d, &self->ids, state_of(m, d, instance));
  vwt_instance_release(self);
}

static int nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return VWT_STATE_COUNT;
}

static int nsensordata(const mjModel* m, int instance, int sensor_id) {
  (void)m, (void)instance, (void)sensor_id;
  return 1;
}

mjPLUGIN_LIB_INIT(vwt_yaw_moment) {
  static const char* const attributes[] = {"joint", "twist_joint"};
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "vwt.yaw_moment";
  plugin.nattribute = sizeof(attributes) / sizeof(attributes[0]);
  plugin.attributes = attributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE | mjPLUGIN_SENSOR;
  // With the velocity stage MuJoCo would compute velocities of subtrees in every step, which are not needed.
  plugin.needstage = mjSTAGE_POS;
  plugin.nstate = nstate;
  plugin.nsensordata = nsensordata;
  plugin.init = init;
  plugin.destroy = destroy;
  plugin.copy = copy;
  plugin.reset = reset;
  plugin.compute = compute;
  plugin.advance = advance;
  mjp_registerPlugin(&plugin);
}
