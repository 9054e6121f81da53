#include "bindings.h"
#include "thumbnails.h"

#include <nanobind/stl/string.h>

namespace nb = nanobind;
using namespace retraverse;

namespace {

using Thumbnails = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Sums = nb::ndarray<std::uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Shapes are checked by the Python function that calls this.
void differences(const Thumbnails &queries, const Thumbnails &references, const Sums &out,
                 bool saturating, unsigned threads, const std::string &instruction_set) {
    ThumbnailProblem problem{};
    problem.difference = saturating ? Difference::saturating : Difference::absolute;
    problem.queries = queries.data();
    problem.references = references.data();
    problem.out = out.data();
    problem.n_queries = queries.shape(0);
    problem.n_references = references.shape(0);
    problem.length = queries.shape(1);
    const nb::gil_scoped_release released;
    thumbnail_differences(problem, threads, instruction_set);
}

} // namespace

void bind_thumbnails(nb::module_ &module) {
    module.def("thumbnail_differences", &differences, nb::arg("queries").noconvert(),
               nb::arg("references").noconvert(), nb::arg("out").noconvert(),
               nb::arg("saturating"), nb::arg("threads"), nb::arg("instruction_set"));
}
