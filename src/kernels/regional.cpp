#include "bindings.h"

void bind_regional(nanobind::module_ &) {}
