// The ids of joints and numerics that an instance of the plugin found in a model. They depend on the model only, and
// are found again when the mjData is used with a model whose names differ. Names are compared once a step; the stages
// of a step compare the model's address and signature.

#ifndef VWT_INSTANCE_H_
#define VWT_INSTANCE_H_

#include <stdint.h>

#include <mujoco/mujoco.h>

#include "moment.h"

// Parameters that are contiguous in the law and whose numerics are contiguous in the model.
typedef struct {
  int parameter, numeric, count;
} vwt_span;

typedef struct {
  int dof;                                // yaw of the rod's upper end
  int twist_dof;                          // of the body relative to that end; -1: the rod is rigid
  int joint, twist_joint;
  int wind_speed, wind_interval;          // ids of numerics; intervals -1 where constant
  int forcing, forcing_interval;          // ids of numerics, -1 where absent
  int ambient, ambient_interval;          // ids of numerics, -1 where absent
  int drive, drive_interval;              // ids of numerics, -1 where absent
  int drive_held, drive_on_end;           // ids of numerics, -1 where absent
  int aero_lag, presliding;               // ids of numerics, -1 where absent
  int program;                            // of the moment by expression; -1 where absent
  int span_count;
  vwt_span span[VWT_PARAMETER_COUNT];     // the parameters that are given in the model
} vwt_ids;

// Sizes that must agree for two models to have the same ids.
#define VWT_SIZES(X) \
  X(nq) X(nv) X(njnt) X(nsensor) X(nnumeric) X(nnumericdata) X(nplugin) X(npluginattr) X(npluginstate) \
  X(nsensordata) X(nuserdata) X(nnames) X(nbuffer)

typedef struct {
#define X(name) mjtSize name;
  VWT_SIZES(X)
#undef X
} vwt_sizes;

typedef struct {
  double time, angle, rate, twist, twist_rate;
} vwt_motion;

// The moments of the law, the drive and the surroundings except friction, N m: on the body, and on the rod's upper end;
// what the joint carries, on which friction may depend; and the moments that the law does not have.
typedef struct {
  double air, mechanism, load, engine;
} vwt_moments;

typedef struct {
  const mjModel* model;                   // the ids hold for it until the step ends; NULL: not compared yet
  uint64_t signature;                     // of this model
  int started;                            // whether the next two are known
  vwt_motion start;                       // at the first stage of the present step, which friction needs in all stages
  vwt_moments start_moments;
  uint64_t layout;                        // of the mjData: sizes of its arrays
  vwt_sizes size;                         // of the model
  vwt_ids ids;
  int numeric_names, attributes;          // where those of numerics and of the instance begin in the model's text
  int joint_name, twist_joint_name;       // of the joints, -1 where there is none
  char text[];                            // all names of the model, then the attributes of all its plugins
} vwt_instance;

// The law's last parameters are attributes of joint and body: they are read there and must not be given as numerics.
enum { VWT_OWN = VWT_INDEX_spring_stiffness };

// Finds the ids that the instance refers to, or raises an error.
void vwt_find_ids(const mjModel* m, int instance, vwt_ids* found);

// What the mjData keeps for this instance; NULL where its plugin is another one.
static inline vwt_instance* vwt_own_instance(const mjModel* m, const mjData* d, int instance) {
  const int own = instance < d->nplugin && d->plugin[instance] == m->plugin[instance];
  return own ? (vwt_instance*)d->plugin_data[instance] : NULL;
}

// The instance with ids that are valid for this model, by its names; an error where the mjData was made for a model of
// different sizes.
vwt_instance* vwt_instance_compared(const mjModel* m, mjData* d, int instance);

// The same within a step, where address and signature are enough.
static inline vwt_instance* vwt_instance_for(const mjModel* m, mjData* d, int instance) {
  vwt_instance* self = vwt_own_instance(m, d, instance);
  return self && self->model == m && self->signature == m->signature ? self : vwt_instance_compared(m, d, instance);
}

// Sets the ids for new or copied data that was made for this model. Returns 0, or -1 if memory is exhausted.
int vwt_instance_renew(const mjModel* m, mjData* d, int instance);

// An error where `kept` was made for a model whose mjData has different sizes.
void vwt_check_layout(const mjModel* m, const vwt_instance* kept);

// Ends a step or a run: the next one compares names, and starts from another motion.
void vwt_instance_release(vwt_instance* self);

#endif  // VWT_INSTANCE_H_
