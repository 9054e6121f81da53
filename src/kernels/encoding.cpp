#include "bindings.h"

void bind_encoding(nanobind::module_ &) {}
