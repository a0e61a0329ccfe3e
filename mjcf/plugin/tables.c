// Names and offsets of the compiled structures by index, for callers that fill them by name.

#include <stddef.h>

#include "expression.h"
#include "forward.h"
#include "moment.h"
#include "state.h"

int vwt_parameter_count(void) { return VWT_PARAMETER_COUNT; }
const char* vwt_parameter_name(int index) { return vwt_parameter_names[index]; }
const char* vwt_parameter_unit(int index) { return vwt_parameter_units[index]; }

#define X(name) #name,
static const char* const state_names[] = {VWT_STATE(X)};
#undef X

int vwt_state_count(void) { return VWT_STATE_COUNT; }
const char* vwt_state_name(int index) { return state_names[index]; }

int vwt_operation_count(void) { return VWT_OPERATION_COUNT; }
const char* vwt_operation_name(int index) { return vwt_operation_names[index]; }

#define X(name) #name,
static const char* const term_names[] = {VWT_TERMS(X)};
#undef X

int vwt_term_count(void) { return VWT_TERM_COUNT; }
const char* vwt_term_name(int index) { return term_names[index]; }
int vwt_most_changes(void) { return VWT_MOST_CHANGES; }

typedef struct {
  const char* name;
  int offset, is_pointer;
} Field;

#define POINTER(name) {#name, offsetof(vwt_run, name), 1},
#define NUMBER(name) {#name, offsetof(vwt_run, name), 0},
static const Field run_fields[] = {VWT_RUN(POINTER, NUMBER)};
#undef POINTER
#undef NUMBER

int vwt_run_size(void) { return sizeof(vwt_run); }
int vwt_run_count(void) { return sizeof(run_fields) / sizeof(run_fields[0]); }
const char* vwt_run_name(int index) { return run_fields[index].name; }
int vwt_run_offset(int index) { return run_fields[index].offset; }
int vwt_run_is_pointer(int index) { return run_fields[index].is_pointer; }
