// What one instance of the plugin found in a model: ids of joints and numerics. It follows from the model alone,
// and is found anew when its mjData meets a model that lists its parts otherwise.

#ifndef VWT_INSTANCE_H_
#define VWT_INSTANCE_H_

#include <stdint.h>

#include <mujoco/mujoco.h>

#include "moment.h"

// Parameters that follow one another in the law as their numerics do in the model.
typedef struct {
  int parameter, numeric, count;
} vwt_span;

typedef struct {
  int dof;                                // yaw of the spring's end of the rod
  int twist_dof;                          // of the body against that end; -1: the rod is rigid
  int joint, twist_joint;
  int wind_speed, wind_interval;          // ids of numerics; intervals -1 where constant
  int forcing, forcing_interval;          // ids of numerics, -1 where absent
  int aero_lag, presliding;               // likewise
  int span_count;
  vwt_span span[VWT_PARAMETER_COUNT];     // the parameters that the model gives
} vwt_ids;

// Sizes that two models share wherever their ids can be the same.
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

// The law's last parameters belong to joint and body: they are read there, never given again as a numeric.
enum { VWT_OWN = VWT_INDEX_spring_stiffness };

// Finds what the instance refers to, or refuses with a message.
void vwt_find_ids(const mjModel* m, int instance, vwt_ids* found);

// The ids that hold for this model; an error where the mjData was made for a model of other sizes.
const vwt_ids* vwt_ids_for(const mjModel* m, mjData* d, int instance);

// Gives new or copied data, whose arrays are those of this model, what belongs to it. 0, or -1 without memory.
int vwt_instance_renew(const mjModel* m, mjData* d, int instance);

// An error where `kept`, of an mjData, was made for a model whose mjData has other sizes.
void vwt_check_layout(const mjModel* m, const vwt_instance* kept);

#endif  // VWT_INSTANCE_H_
