#include "parameters.h"

#define X(name, unit, least) #name,
const char* const vwt_parameter_names[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X
#define X(name, unit, least) unit,
const char* const vwt_parameter_units[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X
#define X(name, unit, least) least,
const double vwt_parameter_least[VWT_PARAMETER_COUNT] = {VWT_PARAMETERS(X)};
#undef X
