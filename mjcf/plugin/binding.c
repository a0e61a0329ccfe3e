#include "binding.h"

#include <math.h>
#include <string.h>

#include "expression.h"

_Static_assert(sizeof(mjtNum) == sizeof(double), "the law and the state are in double precision");

// Share of an interval by which the sum of the steps may fall short of a sample's time.
static const mjtNum kReached = 1e-6;

static int given(const mjModel* m, int numeric) {
  return numeric >= 0 && m->numeric_data[m->numeric_adr[numeric]] != 0;
}

static mjtNum mass_diagonal(const mjModel* m, const mjData* d, int dof) {
  return d->M[m->M_rowadr[dof] + m->M_rownnz[dof] - 1];
}

static mjtNum series_at(const mjModel* m, int values, int interval, mjtNum time) {
  return vwt_series(m->numeric_data + m->numeric_adr[values], m->numeric_size[values],
                    interval < 0 ? 0 : m->numeric_data[m->numeric_adr[interval]], time);
}

static void read_parameters(const mjModel* m, const mjData* d, const vwt_ids* self, vwt_parameters* p) {
  double* table = (double*)p;  // a structure of doubles only, in the order of the law
  if (self->span[0].count == VWT_OWN) {  // contiguous, as build_model writes them: by far the fastest case
    memcpy(p, m->numeric_data + m->numeric_adr[self->span[0].numeric], VWT_OWN * sizeof(double));
  } else {
    memset(p, 0, sizeof(*p));
    for (int i = 0; i < self->span_count; i++) {
      const vwt_span* span = &self->span[i];
      memcpy(table + span->parameter, m->numeric_data + m->numeric_adr[span->numeric], span->count * sizeof(double));
    }
  }
  p->spring_stiffness = m->jnt_stiffness[self->joint];
  p->mechanical_damping = m->dof_damping[self->dof];
  p->yaw_inertia = mass_diagonal(m, d, self->dof);
}

static mjtNum wind_speed_at(const mjModel* m, const mjData* d, const vwt_ids* self, mjtNum time) {
  const mjtNum live = m->nuserdata > 0 ? d->userdata[0] : 0;  // live input, added to the series
  const mjtNum speed = series_at(m, self->wind_speed, self->wind_interval, time) + live;
  return speed > 0 ? speed : 0;
}

static vwt_motion present_motion(const mjModel* m, const mjData* d, const vwt_ids* self) {
  vwt_motion now = {d->time, d->qpos[m->jnt_qposadr[self->joint]], d->qvel[self->dof], 0, 0};
  if (self->twist_dof >= 0) {
    now.twist = d->qpos[m->jnt_qposadr[self->twist_joint]];
    now.twist_rate = d->qvel[self->twist_dof];
  }
  return now;
}

// Motion at the start of the step; the present one before the first step.
static vwt_motion start_motion(const vwt_state* state, const vwt_motion* now) {
  if (state->started == 0) {
    return *now;
  }
  const vwt_motion start = {state->time, state->angle, state->rate, state->twist, state->twist_rate};
  return start;
}

// The lag's time constant depends on the wind speed, which is taken halfway between the step's start and now.
static mjtNum lagged_at(const mjModel* m, const mjData* d, const vwt_ids* self, const vwt_parameters* p,
                        const vwt_state* state, const vwt_motion* now) {
  const mjtNum angle = now->angle + now->twist, rate = now->rate + now->twist_rate;
  if (p->aero_lag == 0 || state->started == 0) {
    return angle;
  }
  const mjtNum halfway = wind_speed_at(m, d, self, 0.5 * (state->time + now->time));
  return vwt_lag_advance(vwt_lag_time(p, halfway), state->lagged, now->time - state->time,
                         state->angle + state->twist, state->rate + state->twist_rate, angle, rate);
}

static mjtNum air_moment(const mjModel* m, const mjData* d, const vwt_ids* self, const vwt_parameters* p,
                         const vwt_state* state, const vwt_motion* at) {
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

// The mechanism's moment, with the moment stated as an expression; the spring's root is at an angle of `root`.
static mjtNum mechanism_moment(const mjModel* m, const mjData* d, const vwt_ids* self, const vwt_parameters* p,
                               const vwt_motion* at, mjtNum root) {
  const mjtNum built_in = vwt_mechanism_moment(p, at->angle, at->angle - root, at->rate);
  if (self->program < 0) {
    return built_in;
  }
  const vwt_program program = {m->numeric_data + m->numeric_adr[self->program], m->numeric_size[self->program]};
  const vwt_program_input in = {at->angle, at->rate, at->time, wind_speed_at(m, d, self, at->time)};
  return built_in + vwt_program_value(&program, &in);
}

// The drive at a time within the step, N m. A held drive has the value at the step's start, so that the last stage of
// a step does not see the next sample.
static mjtNum drive_at(const mjModel* m, const vwt_ids* self, const vwt_state* state, mjtNum time) {
  if (!given(m, self->drive_held)) {
    return series_at(m, self->drive, self->drive_interval, time);
  }
  const mjtNum interval = m->numeric_data[m->numeric_adr[self->drive_interval]];
  const mjtNum start = state->started == 0 ? time : state->time;
  const mjtNum last = m->numeric_size[self->drive] - 1, at = floor(start / interval + kReached);
  return m->numeric_data[m->numeric_adr[self->drive] + (int)mju_clip(at, 0, last)];
}

// Moments on the joint that the law does not have, N m.
typedef struct {
  mjtNum applied;  // of the model's actuators and of the user, which are a load
  mjtNum other;    // of gravity, and of MuJoCo's passive forces beyond the linear spring and damper
} vwt_engine;

// Whether MuJoCo's bias acts on the joint: a single hinge has no Coriolis moment, and gravity has none about an axis
// along it.
static int has_bias(const mjModel* m, const mjData* d, const vwt_ids* self) {
  const int joint = m->dof_jntid[self->dof];
  const mjtNum* axis = d->xaxis + 3 * joint;
  const mjtNum* gravity = m->opt.gravity;
  return m->nv > 1 || m->jnt_type[joint] != mjJNT_HINGE || axis[1] * gravity[2] != axis[2] * gravity[1] ||
         axis[2] * gravity[0] != axis[0] * gravity[2] || axis[0] * gravity[1] != axis[1] * gravity[0];
}

// Those on which friction depends. MuJoCo computes gravity's moment and those of the actuators after the passive forces:
// they are computed here too, since each stage of a step has its own.
static vwt_engine engine_moments(const mjModel* m, mjData* d, const vwt_ids* self, const vwt_parameters* p,
                                 const vwt_motion* now) {
  const int dof = self->dof;
  vwt_engine found = {d->qfrc_applied[dof], 0};
  if (!vwt_rubs(p)) {
    return found;
  }
  if (m->nu > 0) {
    mj_fwdActuation(m, d);
    found.applied += d->qfrc_actuator[dof];
  }
  found.other = d->qfrc_spring[dof] + p->spring_stiffness * now->angle + d->qfrc_damper[dof] +
                p->mechanical_damping * now->rate + d->qfrc_gravcomp[dof] + d->qfrc_fluid[dof];
  if (has_bias(m, d, self)) {
    mj_markStack(d);
    mjtNum* bias = mj_stackAllocNum(d, m->nv);
    mj_rne(m, d, 0, bias);
    found.other -= bias[dof];
    mj_freeStack(d);
  }
  return found;
}

static vwt_moments moments_at(const mjModel* m, const mjData* d, const vwt_ids* self, const vwt_parameters* p,
                              const vwt_state* state, const vwt_motion* at, vwt_engine engine) {
  const mjtNum drive = self->drive < 0 ? 0 : drive_at(m, self, state, at->time);
  const int on_end = given(m, self->drive_on_end);
  const mjtNum root = on_end && drive != 0 && p->spring_stiffness > 0 ? drive / p->spring_stiffness : 0;
  vwt_moments law = {air_moment(m, d, self, p, state, at), mechanism_moment(m, d, self, p, at, root),
                     vwt_load(p, at->angle, engine.applied + (on_end ? 0 : drive)), engine.applied + engine.other};
  if (self->drive >= 0) {
    *(on_end ? &law.mechanism : &law.air) += drive;
  }
  if (self->ambient >= 0) {
    law.air += series_at(m, self->ambient, self->ambient_interval, at->time);
  }
  return law;
}

// All moments on the rod's upper end except friction, including those of MuJoCo's spring, damper and twisted rod.
static mjtNum other_moment(const mjModel* m, const vwt_ids* self, const vwt_parameters* p, vwt_moments law,
                           const vwt_motion* at) {
  const mjtNum mechanism = law.mechanism - p->spring_stiffness * at->angle - p->mechanical_damping * at->rate;
  if (self->twist_dof < 0) {
    return mechanism + law.air;
  }
  return mechanism + m->jnt_stiffness[self->twist_joint] * at->twist + m->dof_damping[self->twist_dof] * at->twist_rate;
}

// The inertia at the rod's upper end.
static mjtNum end_inertia(const mjModel* m, const mjData* d, const vwt_ids* self, const vwt_parameters* p) {
  return self->twist_dof < 0 ? p->yaw_inertia : p->yaw_inertia - mass_diagonal(m, d, self->twist_dof);
}

// Dahl's state; if the start is not known, it is zero until the end of the first step.
static mjtNum deflection_at(const vwt_state* state, mjtNum range, const vwt_motion* now) {
  if (state->started == 0) {
    return 0;
  }
  return vwt_presliding_advance(range, state->deflection, now->time - state->time, state->angle, state->rate,
                                now->angle, now->rate);
}

// The moments at the start of the step. In the first stage they are the present ones, and are kept for the later stages.
// Coefficients may change between calls that do not step, but the time does not.
static vwt_moments moments_at_start(const mjModel* m, const mjData* d, vwt_instance* instance, const vwt_parameters* p,
                                    const vwt_state* state, const vwt_motion* start, const vwt_motion* now,
                                    vwt_moments present, vwt_engine engine) {
  if (memcmp(start, now, sizeof(*now)) == 0) {
    instance->started = 1;
    instance->start = *start;
    instance->start_moments = present;
    return present;
  }
  if (instance->started && now->time > start->time && memcmp(start, &instance->start, sizeof(*start)) == 0) {
    return instance->start_moments;
  }
  return moments_at(m, d, &instance->ids, p, state, start, engine);
}

static mjtNum friction(const mjModel* m, const mjData* d, vwt_instance* instance, const vwt_parameters* p,
                       const vwt_state* state, const vwt_motion* now, vwt_moments present, vwt_engine engine) {
  const vwt_ids* self = &instance->ids;
  const mjtNum inertia = end_inertia(m, d, self, p);
  if (p->presliding > 0) {
    const mjtNum range = vwt_presliding_range(p, inertia, m->opt.timestep);
    const mjtNum least = vwt_friction_least_rate(p, inertia, m->opt.timestep);
    return -deflection_at(state, range, now) / range * vwt_friction_level(p, least, fabs(now->rate), present.load);
  }
  const vwt_motion start = start_motion(state, now);
  const vwt_moments law = moments_at_start(m, d, instance, p, state, &start, now, present, engine);
  const mjtNum other = other_moment(m, self, p, law, &start) + law.engine;
  return vwt_friction_moment(p, inertia, start.rate, other, law.load, m->opt.timestep, now->rate, present.load);
}

void vwt_apply_moments(const mjModel* m, mjData* d, vwt_instance* instance, const vwt_state* state) {
  const vwt_ids* self = &instance->ids;
  vwt_parameters p;
  read_parameters(m, d, self, &p);
  const vwt_motion now = present_motion(m, d, self);
  const vwt_engine engine = engine_moments(m, d, self, &p, &now);
  const vwt_moments law = moments_at(m, d, self, &p, state, &now, engine);
  mjtNum mechanism = law.mechanism;
  if (vwt_rubs(&p)) {
    mechanism += friction(m, d, instance, &p, state, &now, law, engine);
  }
  d->qfrc_passive[self->dof] += law.air + mechanism;
  if (self->twist_dof >= 0) {
    d->qfrc_passive[self->twist_dof] += law.air;
  }
}

void vwt_sense_moment(const mjModel* m, mjData* d, const vwt_ids* self, const vwt_state* state, int instance) {
  vwt_parameters p;
  read_parameters(m, d, self, &p);
  const vwt_motion now = present_motion(m, d, self);
  const mjtNum moment = air_moment(m, d, self, &p, state, &now);
  for (int i = 0; i < m->nsensor; i++) {
    if (m->sensor_type[i] == mjSENS_PLUGIN && m->sensor_plugin[i] == instance) {
      d->sensordata[m->sensor_adr[i]] = moment;
    }
  }
}

void vwt_end_step(const mjModel* m, const mjData* d, const vwt_ids* self, vwt_state* state) {
  const vwt_motion now = present_motion(m, d, self);
  vwt_state end = {
      .lagged = now.angle + now.twist, .angle = now.angle, .rate = now.rate, .twist = now.twist,
      .twist_rate = now.twist_rate, .time = now.time, .started = 1,
  };
  if (given(m, self->aero_lag) || given(m, self->presliding)) {
    vwt_parameters p;
    read_parameters(m, d, self, &p);
    end.lagged = lagged_at(m, d, self, &p, state, &now);
    if (p.presliding > 0) {
      const mjtNum range = vwt_presliding_range(&p, end_inertia(m, d, self, &p), m->opt.timestep);
      end.deflection = deflection_at(state, range, &now);
    }
  }
  *state = end;
}
