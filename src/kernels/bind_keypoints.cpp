#include "bindings.h"
#include "keypoints.h"

#include <nanobind/stl/string.h>

namespace nb = nanobind;
using namespace retraverse;

namespace {

using Descriptors = nb::ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Counts = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matches = nb::ndarray<std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Shapes and counts are checked by the Python function that calls this.
void matches(const Descriptors &queries, const Counts &query_counts, const Descriptors &references,
             const Counts &reference_counts, const Matches &out, int max_distance,
             unsigned threads, const std::string &instruction_set) {
    KeypointProblem problem{};
    problem.queries = queries.data();
    problem.query_counts = query_counts.data();
    problem.references = references.data();
    problem.reference_counts = reference_counts.data();
    problem.out = out.data();
    problem.n_queries = queries.shape(0);
    problem.query_slots = queries.shape(1);
    problem.n_references = references.shape(0);
    problem.reference_slots = references.shape(1);
    problem.max_distance = max_distance;
    const nb::gil_scoped_release released;
    keypoint_matches(problem, threads, instruction_set);
}

} // namespace

void bind_keypoints(nb::module_ &module) {
    module.def("keypoint_matches", &matches, nb::arg("queries").noconvert(),
               nb::arg("query_counts").noconvert(), nb::arg("references").noconvert(),
               nb::arg("reference_counts").noconvert(), nb::arg("out").noconvert(),
               nb::arg("max_distance"), nb::arg("threads"), nb::arg("instruction_set"));
}
