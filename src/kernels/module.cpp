// The Python module of the compiled kernels: one bind_* function per family.
#include "bindings.h"

NB_MODULE(_native, module) {
    module.doc() = "Compiled kernels of retraverse; their NumPy twins are in retraverse.kernels.";
    bind_regional(module);
    bind_encoding(module);
    bind_diagonal(module);
    bind_dtw(module);
    bind_states(module);
    bind_graph(module);
    bind_trajectories(module);
    bind_thumbnails(module);
    bind_keypoints(module);
}
