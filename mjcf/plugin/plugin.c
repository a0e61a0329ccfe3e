// MuJoCo engine plugin "vwt.yaw_moment": the rig's moment law as passive forces, and the aerodynamic
// moment as a sensor. Its attributes and numerics are the table in README.md.
//
// Coefficients live in <custom><numeric> and are read in compute: mujoco.rollout and mujoco.batch reuse one
// mjData for many models, and what is parsed from <config> in init stays that of the first of them.

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <mujoco/mujoco.h>

#include "moment.h"

// Plugin state: where the present step started. Its stages read it for the lag and for friction.
enum { kLagged, kAngle, kRate, kTwist, kTwistRate, kTime, kStarted, kDeflection, kStateCount };

typedef struct {
  mjtNum time, angle, rate, twist, twist_rate;
} Motion;

// Parameters that follow one another in the law as their numerics do in the model.
typedef struct {
  int parameter, numeric, count;
} Span;

typedef struct {
  int dof;                                // yaw of the spring's end of the rod
  int twist_dof;                          // of the body against that end; -1: the rod is rigid
  int joint, twist_joint;
  int wind_speed, wind_interval;          // ids of numerics; intervals -1 where constant
  int forcing, forcing_interval;          // ids of numerics, -1 where absent
  int aero_lag, presliding;               // likewise
  int span_count;
  Span span[VWT_PARAMETER_COUNT];         // the parameters that the model gives
  int names_size;                         // of the names of all numerics, which the ids stand for
  char names[];
} Instance;

// The law's last parameters belong to joint and body: they are read there, never given again as a numeric.
enum { kOwn = VWT_INDEX_spring_stiffness };

// The names of the model's numerics, one after the other, and their size in bytes.
static const char* numeric_names(const mjModel* m, int* size) {
  const char* last = m->names + m->name_numericadr[m->nnumeric - 1];
  const char* first = m->names + m->name_numericadr[0];
  *size = (int)(last - first + strlen(last) + 1);
  return first;
}

// One mjData may serve many models, but the ids found for the first hold only where the others list the same
// numerics in the same order: anything else would give one coefficient the value of another.
static void check_same_numerics(const mjModel* m, const Instance* self) {
  const int start = m->nnumeric > 0 ? m->name_numericadr[0] : (int)m->nnames;
  if (start + self->names_size > (int)m->nnames || memcmp(m->names + start, self->names, self->names_size)) {
    mju_error("vwt.yaw_moment: this model's numerics are not those of the model its mjData was made for; give "
              "all models of a rollout or batch the same numerics in the same order");
  }
}

static mjtNum mass_diagonal(const mjModel* m, const mjData* d, int dof) {
  return d->M[m->M_rowadr[dof] + m->M_rownnz[dof] - 1];
}

static mjtNum series_at(const mjModel* m, int values, int interval, mjtNum time) {
  return vwt_series(m->numeric_data + m->numeric_adr[values], m->numeric_size[values],
                    interval < 0 ? 0 : m->numeric_data[m->numeric_adr[interval]], time);
}

static void read_parameters(const mjModel* m, const mjData* d, const Instance* self, vwt_parameters* p) {
  double* table = (double*)p;  // a structure of doubles only, in the order of the law
  if (self->span[0].count == kOwn) {  // all in one piece, as build_model writes them: much the fastest
    memcpy(p, m->numeric_data + m->numeric_adr[self->span[0].numeric], kOwn * sizeof(double));
  } else {
    memset(p, 0, sizeof(*p));
    for (int i = 0; i < self->span_count; i++) {
      const Span* span = &self->span[i];
      memcpy(table + span->parameter, m->numeric_data + m->numeric_adr[span->numeric], span->count * sizeof(double));
    }
  }
  p->spring_stiffness = m->jnt_stiffness[self->joint];
  p->mechanical_damping = m->dof_damping[self->dof];
  p->yaw_inertia = mass_diagonal(m, d, self->dof);
}

static mjtNum wind_speed_at(const mjModel* m, const mjData* d, const Instance* self, mjtNum time) {
  const mjtNum live = m->nuserdata > 0 ? d->userdata[0] : 0;  // live input: departure from the series
  const mjtNum speed = series_at(m, self->wind_speed, self->wind_interval, time) + live;
  return speed > 0 ? speed : 0;
}

static Motion present_motion(const mjModel* m, const mjData* d, const Instance* self) {
  Motion now = {d->time, d->qpos[m->jnt_qposadr[self->joint]], d->qvel[self->dof], 0, 0};
  if (self->twist_dof >= 0) {
    now.twist = d->qpos[m->jnt_qposadr[self->twist_joint]];
    now.twist_rate = d->qvel[self->twist_dof];
  }
  return now;
}

// Motion at the start of the step; the present one before the first step.
static Motion start_motion(const mjtNum* state, const Motion* now) {
  if (state[kStarted] == 0) {
    return *now;
  }
  const Motion start = {state[kTime], state[kAngle], state[kRate], state[kTwist], state[kTwistRate]};
  return start;
}

// The lag's time constant changes with the wind: that of the time halfway from the step's start is taken.
static mjtNum lagged_at(const mjModel* m, const mjData* d, const Instance* self, const vwt_parameters* p,
                        const mjtNum* state, const Motion* now) {
  const mjtNum angle = now->angle + now->twist, rate = now->rate + now->twist_rate;
  if (p->aero_lag == 0 || state[kStarted] == 0) {
    return angle;
  }
  const mjtNum halfway = wind_speed_at(m, d, self, 0.5 * (state[kTime] + now->time));
  return vwt_lag_advance(vwt_lag_time(p, halfway), state[kLagged], now->time - state[kTime],
                         state[kAngle] + state[kTwist], state[kRate] + state[kTwistRate], angle, rate);
}

static mjtNum air_moment(const mjModel* m, const mjData* d, const Instance* self, const vwt_parameters* p,
                         const mjtNum* state, const Motion* at) {
  const vwt_air_state air = {
      .time = at->time,
      .wind_speed = wind_speed_at(m, d, self, at->time),
      .angle = at->angle + at->twist,
      .rate = at->rate + at->twist_rate,
      .lagged = p->aero_lag != 0 ? lagged_at(m, d, self, p, state, at) : 0,
      .forcing = self->forcing < 0 ? 0 : series_at(m, self->forcing, self->forcing_interval, at->time),
  };
  return vwt_air_moment(p, &air);
}

// All moments on the spring's end but friction, those of MuJoCo's own spring, damper and rod included.
static mjtNum other_moment(const mjModel* m, const Instance* self, const vwt_parameters* p, mjtNum air,
                           const Motion* at) {
  const mjtNum mechanism = vwt_mechanism_moment(p, at->angle, at->rate) - p->spring_stiffness * at->angle -
                           p->mechanical_damping * at->rate;
  if (self->twist_dof < 0) {
    return mechanism + air;
  }
  return mechanism + m->jnt_stiffness[self->twist_joint] * at->twist + m->dof_damping[self->twist_dof] * at->twist_rate;
}

// What turns at the spring's end.
static mjtNum end_inertia(const mjModel* m, const mjData* d, const Instance* self, const vwt_parameters* p) {
  return self->twist_dof < 0 ? p->yaw_inertia : p->yaw_inertia - mass_diagonal(m, d, self->twist_dof);
}

// Dahl's state: zero until the end of the first step where the start is not known.
static mjtNum deflection_at(const mjtNum* state, mjtNum range, const Motion* now) {
  if (state[kStarted] == 0) {
    return 0;
  }
  return vwt_presliding_advance(range, state[kDeflection], now->time - state[kTime], state[kAngle], state[kRate],
                                now->angle, now->rate);
}

static mjtNum friction(const mjModel* m, const mjData* d, const Instance* self, const vwt_parameters* p,
                       const mjtNum* state, const Motion* now) {
  const mjtNum inertia = end_inertia(m, d, self, p);
  if (p->presliding > 0) {
    const mjtNum range = vwt_presliding_range(p, inertia, m->opt.timestep);
    return -deflection_at(state, range, now) / range * p->friction_moment;
  }
  const Motion start = start_motion(state, now);
  const mjtNum applied = d->qfrc_applied[self->dof];  // by the user, on the spring's end
  const mjtNum other = other_moment(m, self, p, air_moment(m, d, self, p, state, &start), &start) + applied;
  return vwt_friction_moment(p, inertia, start.rate, other, m->opt.timestep);
}

static void apply_moments(const mjModel* m, mjData* d, const Instance* self, const mjtNum* state) {
  vwt_parameters p;
  read_parameters(m, d, self, &p);
  const Motion now = present_motion(m, d, self);
  const mjtNum air = air_moment(m, d, self, &p, state, &now);
  mjtNum mechanism = vwt_mechanism_moment(&p, now.angle, now.rate);
  if (p.friction_moment > 0) {
    mechanism += friction(m, d, self, &p, state, &now);
  }
  d->qfrc_passive[self->dof] += air + mechanism;
  if (self->twist_dof >= 0) {
    d->qfrc_passive[self->twist_dof] += air;
  }
}

static void sense_moment(const mjModel* m, mjData* d, const Instance* self, const mjtNum* state, int instance) {
  vwt_parameters p;
  read_parameters(m, d, self, &p);
  const Motion now = present_motion(m, d, self);
  const mjtNum moment = air_moment(m, d, self, &p, state, &now);
  for (int i = 0; i < m->nsensor; i++) {
    if (m->sensor_type[i] == mjSENS_PLUGIN && m->sensor_plugin[i] == instance) {
      d->sensordata[m->sensor_adr[i]] = moment;
    }
  }
}

static void compute(const mjModel* m, mjData* d, int instance, int capability_bit) {
  const Instance* self = (const Instance*)d->plugin_data[instance];
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  if (capability_bit & mjPLUGIN_PASSIVE) {
    apply_moments(m, d, self, state);
  } else if (capability_bit & mjPLUGIN_SENSOR) {
    sense_moment(m, d, self, state, instance);
  }
}

static int given(const mjModel* m, int numeric) {
  return numeric >= 0 && m->numeric_data[m->numeric_adr[numeric]] != 0;
}

static void advance(const mjModel* m, mjData* d, int instance) {
  const Instance* self = (const Instance*)d->plugin_data[instance];
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  check_same_numerics(m, self);
  const Motion now = present_motion(m, d, self);
  mjtNum lagged = now.angle + now.twist, deflection = 0;
  if (given(m, self->aero_lag) || given(m, self->presliding)) {
    vwt_parameters p;
    read_parameters(m, d, self, &p);
    lagged = lagged_at(m, d, self, &p, state, &now);
    if (p.presliding > 0) {
      const mjtNum range = vwt_presliding_range(&p, end_inertia(m, d, self, &p), m->opt.timestep);
      deflection = deflection_at(state, range, &now);
    }
  }
  state[kLagged] = lagged;
  state[kDeflection] = deflection;
  state[kAngle] = now.angle;
  state[kRate] = now.rate;
  state[kTwist] = now.twist;
  state[kTwistRate] = now.twist_rate;
  state[kTime] = now.time;
  state[kStarted] = 1;
}

//------------------------------ configuration ---------------------------------------------------------

static int find_numeric(const mjModel* m, const char* name) { return mj_name2id(m, mjOBJ_NUMERIC, name); }

// id of the hinge named by an attribute, -1 where the attribute is empty
static int find_hinge(const mjModel* m, int instance, const char* attribute) {
  const char* name = mj_getPluginConfig(m, instance, attribute);
  if (!name || !*name) {
    return -1;
  }
  const int joint = mj_name2id(m, mjOBJ_JOINT, name);
  if (joint < 0 || m->jnt_type[joint] != mjJNT_HINGE) {
    mju_error("vwt.yaw_moment: %s=\"%s\" names no hinge of the model", attribute, name);
  }
  return joint;
}

static void check_series(const mjModel* m, int values, int interval, const char* name) {
  for (int i = 0; values >= 0 && i < m->numeric_size[values]; i++) {
    if (!isfinite(m->numeric_data[m->numeric_adr[values] + i])) {
      mju_error("vwt.yaw_moment: numeric %s is not finite at sample %d", name, i);
    }
  }
  if (interval < 0) {
    if (values >= 0 && m->numeric_size[values] > 1) {
      mju_error("vwt.yaw_moment: numeric %s is a series: give its %s_interval in s", name, name);
    }
    return;
  }
  const mjtNum step = m->numeric_data[m->numeric_adr[interval]];
  if (m->numeric_size[interval] != 1 || !(step > 0) || !isfinite(step)) {
    mju_error("vwt.yaw_moment: numeric %s_interval must be one positive number in s", name);
  }
  if (values < 0) {
    mju_error("vwt.yaw_moment: numeric %s_interval is given without %s", name, name);
  }
}

// A coefficient whose name is misspelt would silently stay zero.
static void check_names(const mjModel* m) {
  static const char* const series[] = {"wind_speed", "wind_speed_interval", "forcing", "forcing_interval"};
  for (int i = 0; i < m->nnumeric; i++) {
    const char* name = m->names + m->name_numericadr[i];
    int known = !strncmp(name, "user_", 5);
    for (int k = 0; k < VWT_PARAMETER_COUNT && !known; k++) {
      known = !strcmp(name, vwt_parameter_names[k]);
    }
    for (int k = 0; k < 4 && !known; k++) {
      known = !strcmp(name, series[k]);
    }
    if (!known) {
      mju_error("vwt.yaw_moment: numeric %s is unknown; correct it by the table in the plugin's README, or begin "
                "its name with user_ if it is not the plugin's", name);
    }
  }
}

static void find_series(const mjModel* m, Instance* self) {
  self->wind_speed = find_numeric(m, "wind_speed");
  self->wind_interval = find_numeric(m, "wind_speed_interval");
  self->forcing = find_numeric(m, "forcing");
  self->forcing_interval = find_numeric(m, "forcing_interval");
  if (self->wind_speed < 0) {
    mju_error("vwt.yaw_moment: numeric wind_speed is missing; give it in m/s, 0 for wind-off");
  }
  check_series(m, self->wind_speed, self->wind_interval, "wind_speed");
  check_series(m, self->forcing, self->forcing_interval, "forcing");
  for (int i = 0; i < m->numeric_size[self->wind_speed]; i++) {
    if (m->numeric_data[m->numeric_adr[self->wind_speed] + i] < 0) {
      mju_error("vwt.yaw_moment: numeric wind_speed is negative at sample %d", i);
    }
  }
}

static void find_parameters(const mjModel* m, Instance* self) {
  self->span_count = 0;
  self->aero_lag = find_numeric(m, "aero_lag");
  self->presliding = find_numeric(m, "presliding");
  for (int i = 0; i < VWT_PARAMETER_COUNT; i++) {
    const char* name = vwt_parameter_names[i];
    const int id = find_numeric(m, name);
    const int required = i == VWT_INDEX_air_density || i == VWT_INDEX_frontal_area ||
                         i == VWT_INDEX_reference_length || i == VWT_INDEX_cn_beta || i == VWT_INDEX_cn_r;
    if (id < 0) {
      if (required) {
        mju_error("vwt.yaw_moment: numeric %s is missing; give it in %s", name, vwt_parameter_units[i]);
      }
      continue;
    }
    if (i >= kOwn) {
      mju_error("vwt.yaw_moment: numeric %s repeats what the joint or body owns; remove it", name);
    }
    const mjtNum value = m->numeric_data[m->numeric_adr[id]];
    if (m->numeric_size[id] != 1 || !isfinite(value) || value < vwt_parameter_least[i]) {
      const int bounded = vwt_parameter_least[i] > -VWT_ANY;
      mju_error("vwt.yaw_moment: numeric %s must be one finite number%s in %s", name,
                bounded ? " of zero or more" : "", vwt_parameter_units[i]);
    }
    Span* last = self->span_count ? &self->span[self->span_count - 1] : NULL;
    if (last && i == last->parameter + last->count && id == last->numeric + last->count) {
      last->count++;
    } else {
      self->span[self->span_count++] = (Span){i, id, 1};
    }
  }
}

static void find_joints(const mjModel* m, int instance, Instance* self) {
  self->joint = find_hinge(m, instance, "joint");
  if (self->joint < 0) {
    mju_error("vwt.yaw_moment: attribute joint is missing; name the hinge in yaw");
  }
  self->twist_joint = find_hinge(m, instance, "twist_joint");
  if (self->twist_joint == self->joint) {
    mju_error("vwt.yaw_moment: twist_joint is the same hinge as joint; name the hinge of the rod's twist");
  }
  self->dof = m->jnt_dofadr[self->joint];
  self->twist_dof = self->twist_joint < 0 ? -1 : m->jnt_dofadr[self->twist_joint];
}

// Finds what the instance refers to, or refuses with a message.
static void configure(const mjModel* m, int instance, Instance* found) {
  if (mj_version() != mjVERSION_HEADER) {
    mju_error("vwt.yaw_moment: built against MuJoCo %d but loaded by %d; rebuild the package", mjVERSION_HEADER,
              mj_version());
  }
  if (m->opt.disableflags & mjDSBL_SPRING && m->opt.disableflags & mjDSBL_DAMPER) {
    mju_error("vwt.yaw_moment: springs and dampers are both disabled, which disables the plugin too; set the "
              "joint's stiffness or damping to zero instead");
  }
  memset(found, 0, sizeof(*found));
  find_joints(m, instance, found);
  check_names(m);
  find_series(m, found);
  find_parameters(m, found);
}

static int init(const mjModel* m, mjData* d, int instance) {
  Instance found;
  configure(m, instance, &found);
  const char* names = numeric_names(m, &found.names_size);
  Instance* self = (Instance*)malloc(sizeof(Instance) + found.names_size);  // last: a refusal must not leak it
  if (!self) {
    return -1;
  }
  *self = found;
  memcpy(self->names, names, found.names_size);
  d->plugin_data[instance] = (uintptr_t)self;
  return 0;
}

static void destroy(mjData* d, int instance) {
  free((void*)d->plugin_data[instance]);
  d->plugin_data[instance] = 0;
}

static void copy(mjData* dest, const mjModel* m, const mjData* src, int instance) {
  (void)m;
  const Instance* from = (const Instance*)src->plugin_data[instance];
  const size_t size = sizeof(Instance) + from->names_size;
  Instance* to = (Instance*)realloc((void*)dest->plugin_data[instance], size);
  if (!to) {
    mju_error("vwt.yaw_moment: out of memory");
  }
  memcpy(to, from, size);
  dest->plugin_data[instance] = (uintptr_t)to;
}

static void reset(const mjModel* m, mjtNum* plugin_state, void* plugin_data, int instance) {
  (void)m, (void)plugin_data, (void)instance;
  memset(plugin_state, 0, kStateCount * sizeof(mjtNum));
}

static int nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return kStateCount;
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
  // The sensor reads the state alone. Asking for the velocity stage would have MuJoCo compute velocities of
  // subtrees in every step, which nobody reads.
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
