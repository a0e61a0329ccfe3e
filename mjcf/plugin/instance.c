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

// Contiguous strings of a model, including the terminating zero of the last.
typedef struct {
  const char* text;
  int size;
} Strings;

static Strings strings(const char* first, const char* last) {
  return (Strings){first, (int)(last - first + strlen(last) + 1)};
}

static Strings numeric_names(const mjModel* m) {
  return strings(m->names + m->name_numericadr[0], m->names + m->name_numericadr[m->nnumeric - 1]);
}

// Values of the plugin's two attributes.
static Strings attributes(const mjModel* m, int instance) {
  const char* first = m->plugin_attr + m->plugin_attradr[instance];
  return strings(first, first + strlen(first) + 1);
}

// Whether `size` bytes at `start` of a model's text pool equal those kept.
static int same_text(const char* pool, mjtSize pool_size, int start, const char* kept, int size) {
  return start >= 0 && start + size <= pool_size && memcmp(pool + start, kept, size) == 0;
}

// String comparison without a function call, which for a few characters would take longer than the comparison.
static int same_word(const char* one, const char* other) {
  while (*one == *other && *one) {
    one++, other++;
  }
  return *one == *other;
}

static int same_attributes(const mjModel* m, int instance, const char* kept, int second) {
  const int start = m->plugin_attradr[instance];
  return start >= 0 && same_word(m->plugin_attr + start, kept) && same_word(m->plugin_attr + start + second, kept + second);
}

static int same_hinge(const mjModel* m, int joint, int dof, const char* name) {
  return joint < 0 || (m->jnt_type[joint] == mjJNT_HINGE && m->jnt_dofadr[joint] == dof &&
                       same_word(m->names + m->name_jntadr[joint], name));
}

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

// Whether the ids are valid for this model. This is checked at every call: models may share an mjData, and a new model
// may have the address of an old one, so addresses cannot be compared instead.
static int holds(const vwt_instance* self, const mjModel* m, int instance) {
  const vwt_ids* ids = &self->ids;
  const char* joint = self->text + self->names_size;
  const char* twist_joint = joint + self->second;
  return same_sizes(&self->size, m) &&
         same_text(m->names, m->nnames, m->name_numericadr[0], self->text, self->names_size) &&
         same_attributes(m, instance, joint, self->second) && same_hinge(m, ids->joint, ids->dof, joint) &&
         same_hinge(m, ids->twist_joint, ids->twist_dof, twist_joint) && same_spans(m, ids);
}

static vwt_instance* make(const mjModel* m, int instance) {
  vwt_ids found;
  vwt_find_ids(m, instance, &found);  // before the allocation, because an error does not return
  const Strings names = numeric_names(m), values = attributes(m, instance);
  vwt_instance* self = (vwt_instance*)malloc(sizeof(vwt_instance) + names.size + values.size);
  if (!self) {
    return NULL;
  }
  self->layout = layout_of(m);
  self->size = sizes_of(m);
  self->ids = found;
  self->names_size = names.size;
  self->second = (int)strlen(values.text) + 1;
  memcpy(self->text, names.text, names.size);
  memcpy(self->text + names.size, values.text, values.size);
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

const vwt_ids* vwt_ids_for(const mjModel* m, mjData* d, int instance) {
  const int own = instance < d->nplugin && d->plugin[instance] == m->plugin[instance];
  const vwt_instance* self = own ? (const vwt_instance*)d->plugin_data[instance] : NULL;
  if (self && holds(self, m, instance)) {
    return &self->ids;
  }
  vwt_check_layout(m, self);
  if (vwt_instance_renew(m, d, instance)) {
    mju_error("vwt.yaw_moment: out of memory");
  }
  return &((const vwt_instance*)d->plugin_data[instance])->ids;
}
