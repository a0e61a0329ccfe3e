#include "instance.h"

#include <stdlib.h>
#include <string.h>

#include <mujoco/mjxmacro.h>

// A hash of the sizes of a model's mjData (FNV-1a over the lengths of all arrays in its buffer).
static uint64_t layout_of(const mjModel* m) {
  uint64_t hash = 14695981039346656037u;
#undef XNV
#define XNV X
#define X(type, name, nr, nc) hash = (hash ^ (uint64_t)(m->nr) * (uint64_t)(nc)) * 1099511628211u;
  MJDATA_POINTERS
#undef X
  return hash;
}

static vwt_sizes sizes_of(const mjModel* m) {
#define X(name) .name = m->name,
  return (vwt_sizes){VWT_SIZES(X)};
#undef X
}

static int same_sizes(const vwt_sizes* kept, const mjModel* m) {
#define X(name) && kept->name == m->name
  return 1 VWT_SIZES(X);
#undef X
}

static int same_joint(const mjModel* m, int joint, int dof, int name) {
  return joint < 0 || (m->jnt_type[joint] >= mjJNT_SLIDE && m->jnt_dofadr[joint] == dof && m->name_jntadr[joint] == name);
}

static int name_of(const mjModel* m, int joint) { return joint < 0 ? -1 : m->name_jntadr[joint]; }

// Whether the parameters of each span are contiguous in this model.
static int same_spans(const mjModel* m, const vwt_ids* ids) {
  for (int i = 0; i < ids->span_count; i++) {
    const vwt_span* span = &ids->span[i];
    const int last = span->numeric + span->count - 1;
    if (m->numeric_adr[last] != m->numeric_adr[span->numeric] + span->count - 1) {
      return 0;
    }
  }
  return 1;
}

// Whether the ids are valid for this model. Models may share an mjData, and a new model may have the address of an old
// one and the same signature, which covers the tree but not the numerics: only names are certain.
static int holds(const vwt_instance* self, const mjModel* m, int instance) {
  const vwt_ids* ids = &self->ids;
  return same_sizes(&self->size, m) && m->name_numericadr[0] == self->numeric_names &&
         m->plugin_attradr[instance] == self->attributes &&
         same_joint(m, ids->joint, ids->dof, self->joint_name) &&
         same_joint(m, ids->twist_joint, ids->twist_dof, self->twist_joint_name) && same_spans(m, ids) &&
         memcmp(m->names, self->text, m->nnames) == 0 &&
         memcmp(m->plugin_attr, self->text + m->nnames, m->npluginattr) == 0;
}

void vwt_instance_release(vwt_instance* self) {
  self->model = NULL;
  self->started = 0;
}

static vwt_instance* make(const mjModel* m, int instance) {
  vwt_ids found;
  vwt_find_ids(m, instance, &found);  // before the allocation, because an error does not return
  vwt_instance* self = (vwt_instance*)malloc(sizeof(vwt_instance) + m->nnames + m->npluginattr);
  if (!self) {
    return NULL;
  }
  vwt_instance_release(self);
  self->layout = layout_of(m);
  self->size = sizes_of(m);
  self->ids = found;
  self->numeric_names = m->name_numericadr[0];
  self->attributes = m->plugin_attradr[instance];
  self->joint_name = name_of(m, found.joint);
  self->twist_joint_name = name_of(m, found.twist_joint);
  memcpy(self->text, m->names, m->nnames);
  memcpy(self->text + m->nnames, m->plugin_attr, m->npluginattr);
  return self;
}

int vwt_instance_renew(const mjModel* m, mjData* d, int instance) {
  vwt_instance* self = make(m, instance);
  if (!self) {
    return -1;
  }
  free((void*)d->plugin_data[instance]);
  d->plugin_data[instance] = (uintptr_t)self;
  return 0;
}

void vwt_check_layout(const mjModel* m, const vwt_instance* kept) {
  if (!kept || kept->layout != layout_of(m)) {
    mju_error("vwt.yaw_moment: this mjData was made for a model of other sizes; make one for this model");
  }
}

vwt_instance* vwt_instance_compared(const mjModel* m, mjData* d, int instance) {
  vwt_instance* self = vwt_own_instance(m, d, instance);
  if (!self || !holds(self, m, instance)) {
    vwt_check_layout(m, self);
    if (vwt_instance_renew(m, d, instance)) {
      mju_error("vwt.yaw_moment: out of memory");
    }
    self = (vwt_instance*)d->plugin_data[instance];
  }
  vwt_instance_release(self);
  self->model = m;
  self->signature = m->signature;
  return self;
}
