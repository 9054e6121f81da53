#include "bindings.h"
#include "cpu.h"
#include "regional.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace nb = nanobind;
using namespace retraverse;

namespace {

using Input = nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>;
using Weights = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Scores = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Shapes and types are checked by the Python function that calls this.
long long scores(const Input &query, const Input &references, const Weights &weights,
                 const Scores &out, unsigned threads, const std::string &instruction_set) {
    RegionalProblem problem{};
    problem.element = query.dtype() == nb::dtype<float>() ? Element::float32 : Element::uint8;
    problem.query = query.data();
    problem.references = references.data();
    problem.weights = weights.data();
    problem.out = out.data();
    problem.query_regions = query.shape(0);
    problem.length = query.shape(1);
    problem.n_references = references.shape(0);
    problem.regions = references.shape(1);
    problem.rows = weights.shape(0);
    const nb::gil_scoped_release released;
    return static_cast<long long>(regional_scores(problem, threads, instruction_set));
}

std::vector<std::string> names() {
    std::vector<std::string> found;
    for (InstructionSet set : instruction_sets())
        found.emplace_back(name_of(set));
    return found;
}

} // namespace

void bind_regional(nb::module_ &module) {
    module.def("instruction_sets", &names, "Instruction sets that can run here, newest first.");
    module.def("regional_scores", &scores, nb::arg("query"), nb::arg("references"),
               nb::arg("weights"), nb::arg("out"), nb::arg("threads"), nb::arg("instruction_set"),
               "Write the scores into out; return -1 or the first reference that is not finite.");
}
