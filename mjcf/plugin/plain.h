// Plain runs, which are integrated side by side (lanes.c).

#ifndef VWT_PLAIN_H_
#define VWT_PLAIN_H_

#include "parameters.h"
#include "run.h"

// Runs that `vwt_forward` may integrate side by side: no imposed moment, a wind that is constant where the air has a
// lag or sheds vortices, a drive whose samples are at the starts of steps, and neither a lag nor Dahl's friction with
// a rod that twists.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define VWT_WIDE 1  // a loader that chooses code by processor; a sanitizer is not ready when it does
enum { VWT_LANES = 8 };
#else
#define VWT_WIDE 0
enum { VWT_LANES = 4 };
#endif
int vwt_is_plain(const vwt_parameters* p, const vwt_run* run);
int vwt_alike(const vwt_parameters* p, const vwt_run* one, const vwt_parameters* q, const vwt_run* other);

// Integrates up to `VWT_LANES` plain runs that are alike. Returns as `vwt_forward`.
int vwt_integrate_lanes(int count, const vwt_parameters* parameters, const vwt_run* runs, double* const* angle,
                        double* const* rate);

#endif  // VWT_PLAIN_H_
