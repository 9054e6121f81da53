#include "bindings.h"

void bind_diagonal(nanobind::module_ &) {}
