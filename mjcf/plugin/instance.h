// The ids of joints and numerics that an instance of the plugin found in a model. They depend on the model only, and
// are found again when the mjData is used with a model whose names differ.

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
  int aero_lag, presliding;               // ids of numerics, -1 where absent
  int program;                            // of the moment by expression; -1 where absent
  int span_count;
  vwt_span span[VWT_PARAMETER_COUNT];     // the parameters that are given in the model
} vwt_ids;

// Sizes that must agree for two models to have the same ids.
#define VWT_SIZES(X) \
  X(nq) X(nv) X(njnt) X(nsensor) X(nnumeric) X(nnumericdata) X(nplugin) X(npluginattr) X(npluginstate) \
  X(nsensordata) X(nuserdata) X(nbuffer)

typedef struct {
#define X(name) mjtSize name;
  VWT_SIZES(X)
#undef X
} vwt_sizes;

typedef struct {
  uint64_t layout;                        // of the mjData: sizes of its arrays
  vwt_sizes size;                         // of the model
  vwt_ids ids;
  int names_size;                         // bytes
  int second;                             // where the second attribute begins after the first
  char text[];                            // names of all numerics, then the instance's attributes
} vwt_instance;

// The law's last parameters are attributes of joint and body: they are read there and must not be given as numerics.
enum { VWT_OWN = VWT_INDEX_spring_stiffness };

// Finds the ids that the instance refers to, or raises an error.
void vwt_find_ids(const mjModel* m, int instance, vwt_ids* found);

// The ids that are valid for this model; an error where the mjData was made for a model of different sizes.
const vwt_ids* vwt_ids_for(const mjModel* m, mjData* d, int instance);

// Sets the ids for new or copied data that was made for this model. Returns 0, or -1 if memory is exhausted.
int vwt_instance_renew(const mjModel* m, mjData* d, int instance);

// An error where `kept` was made for a model whose mjData has different sizes.
void vwt_check_layout(const mjModel* m, const vwt_instance* kept);

#endif  // VWT_INSTANCE_H_
