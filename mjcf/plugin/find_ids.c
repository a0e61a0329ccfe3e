// What the instance's attributes and the model's numerics refer to. Whatever is wrong with them is refused by name.

#include <math.h>
#include <string.h>

#include "expression.h"
#include "instance.h"

static int find_numeric(const mjModel* m, const char* name) { return mj_name2id(m, mjOBJ_NUMERIC, name); }

// id of the joint named by an attribute, a hinge or, where it may be, a slide; -1 where the attribute is empty
static int find_joint(const mjModel* m, int instance, const char* attribute, int may_slide) {
  const char* name = mj_getPluginConfig(m, instance, attribute);
  if (!name || !*name) {
    return -1;
  }
  const int joint = mj_name2id(m, mjOBJ_JOINT, name);
  const int type = joint < 0 ? mjJNT_FREE : m->jnt_type[joint];
  if (type != mjJNT_HINGE && !(may_slide && type == mjJNT_SLIDE)) {
    mju_error("vwt.yaw_moment: %s=\"%s\" names no hinge%s of the model", attribute, name, may_slide ? " or slide" : "");
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
  static const char* const series[] = {"wind_speed", "wind_speed_interval", "forcing", "forcing_interval", "ambient", "ambient_interval",
                                      "drive", "drive_interval", "drive_held", "drive_on_end", "moment_program"};
  const int count = sizeof(series) / sizeof(series[0]);
  for (int i = 0; i < m->nnumeric; i++) {
    const char* name = m->names + m->name_numericadr[i];
    int known = !strncmp(name, "user_", 5);
    for (int k = 0; k < VWT_PARAMETER_COUNT && !known; k++) {
      known = !strcmp(name, vwt_parameter_names[k]);
    }
    for (int k = 0; k < count && !known; k++) {
      known = !strcmp(name, series[k]);
    }
    if (!known) {
      mju_error("vwt.yaw_moment: numeric %s is unknown; correct it by the table in the plugin's README, or begin "
                "its name with user_ if it is not the plugin's", name);
    }
  }
}

static void find_drive(const mjModel* m, vwt_ids* self) {
  self->drive = find_numeric(m, "drive");
  self->drive_interval = find_numeric(m, "drive_interval");
  self->drive_held = find_numeric(m, "drive_held");
  self->drive_on_end = find_numeric(m, "drive_on_end");
  check_series(m, self->drive, self->drive_interval, "drive");
  if (self->drive < 0 && (self->drive_held >= 0 || self->drive_on_end >= 0)) {
    mju_error("vwt.yaw_moment: numeric %s is given without drive",
              self->drive_held >= 0 ? "drive_held" : "drive_on_end");
  }
  if (self->drive >= 0 && self->drive_interval < 0) {
    mju_error("vwt.yaw_moment: numeric drive is a series: give its drive_interval in s");
  }
}

static void find_series(const mjModel* m, vwt_ids* self) {
  self->wind_speed = find_numeric(m, "wind_speed");
  self->wind_interval = find_numeric(m, "wind_speed_interval");
  self->forcing = find_numeric(m, "forcing");
  self->forcing_interval = find_numeric(m, "forcing_interval");
  self->ambient = find_numeric(m, "ambient");
  self->ambient_interval = find_numeric(m, "ambient_interval");
  if (self->wind_speed < 0) {
    mju_error("vwt.yaw_moment: numeric wind_speed is missing; give it in m/s, 0 for wind-off");
  }
  check_series(m, self->wind_speed, self->wind_interval, "wind_speed");
  check_series(m, self->forcing, self->forcing_interval, "forcing");
  check_series(m, self->ambient, self->ambient_interval, "ambient");
  find_drive(m, self);
  for (int i = 0; i < m->numeric_size[self->wind_speed]; i++) {
    if (m->numeric_data[m->numeric_adr[self->wind_speed] + i] < 0) {
      mju_error("vwt.yaw_moment: numeric wind_speed is negative at sample %d", i);
    }
  }
}

static void find_parameters(const mjModel* m, vwt_ids* self) {
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
    if (i >= VWT_OWN) {
      mju_error("vwt.yaw_moment: numeric %s repeats what the joint or body owns; remove it", name);
    }
    const mjtNum value = m->numeric_data[m->numeric_adr[id]];
    if (m->numeric_size[id] != 1 || !isfinite(value) || value < vwt_parameter_least[i]) {
      const int bounded = vwt_parameter_least[i] > -VWT_ANY;
      mju_error("vwt.yaw_moment: numeric %s must be one finite number%s in %s", name,
                bounded ? " of zero or more" : "", vwt_parameter_units[i]);
    }
    vwt_span* last = self->span_count ? &self->span[self->span_count - 1] : NULL;
    if (last && i == last->parameter + last->count && id == last->numeric + last->count) {
      last->count++;
    } else {
      self->span[self->span_count++] = (vwt_span){i, id, 1};
    }
  }
}

// A program that is malformed anywhere is so for every input.
static void find_program(const mjModel* m, vwt_ids* self) {
  self->program = find_numeric(m, "moment_program");
  if (self->program < 0) {
    return;
  }
  const vwt_program program = {m->numeric_data + m->numeric_adr[self->program], m->numeric_size[self->program]};
  if (!vwt_program_sound(&program)) {
    mju_error("vwt.yaw_moment: numeric moment_program is not a program; write it with tunnel_sim");
  }
}

static void find_joints(const mjModel* m, int instance, vwt_ids* self) {
  self->joint = find_joint(m, instance, "joint", 1);
  if (self->joint < 0) {
    mju_error("vwt.yaw_moment: attribute joint is missing; name the hinge in yaw");
  }
  self->twist_joint = find_joint(m, instance, "twist_joint", 0);
  if (self->twist_joint == self->joint) {
    mju_error("vwt.yaw_moment: twist_joint is the same hinge as joint; name the hinge of the rod's twist");
  }
  self->dof = m->jnt_dofadr[self->joint];
  self->twist_dof = self->twist_joint < 0 ? -1 : m->jnt_dofadr[self->twist_joint];
}

void vwt_find_ids(const mjModel* m, int instance, vwt_ids* found) {
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
  find_program(m, found);
}
