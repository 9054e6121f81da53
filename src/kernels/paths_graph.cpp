// Data association graph: the best path through matching and hidden nodes.
//
// Every pair (query, reference) is two nodes: one where the pictures match, worth the pair's
// evidence, and a hidden one where they do not, worth `hidden`. Edges lead to the next query's
// nodes within reach of the moves. Coming out of hiding costs `surface`; a hidden path may go on
// anywhere at the cost `jump`.
#include "bindings.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using State = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Moves = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Codes = nb::ndarray<std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Index = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr std::int32_t jumped = 63, was_hidden = 128;

// The better of a frame's two nodes to come from, and which it was.
struct Origins {
    std::vector<float> value;
    std::vector<std::int32_t> layer;
    explicit Origins(std::size_t n) : value(n), layer(n) {}

    void choose(const float *__restrict matching, const float *__restrict hidden, float toll) {
        for (std::size_t j = 0; j < value.size(); ++j) {
            const float from_hidden = hidden[j] - toll, from_matching = matching[j];
            value[j] = from_hidden > from_matching ? from_hidden : from_matching;
            layer[j] = -static_cast<std::int32_t>(from_hidden > from_matching) & was_hidden;
        }
    }
};

struct Arrivals {
    std::vector<float> value;
    std::vector<std::int32_t> code;
    explicit Arrivals(std::size_t n) : value(n), code(n) {}

    void fill(float far, std::int32_t how) {
        std::fill(value.begin(), value.end(), far);
        std::fill(code.begin(), code.end(), how);
    }

    void offer(const Origins &origins, std::int64_t move, std::int32_t how) {
        const auto n = static_cast<std::int64_t>(value.size());
        const std::int64_t first = std::max<std::int64_t>(move, 0);
        const std::int64_t end = n + std::min<std::int64_t>(move, 0);
        const float *__restrict from = origins.value.data();
        const std::int32_t *__restrict layer = origins.layer.data();
        float *__restrict best = value.data();
        std::int32_t *__restrict codes = code.data();
        for (std::int64_t j = first; j < end; ++j) {
            const float arriving = from[j - move], known = best[j];
            // A mask, not a condition: the compiler would make it a branch and use no vectors.
            const std::int32_t better = -static_cast<std::int32_t>(arriving > known);
            best[j] = arriving > known ? arriving : known;
            codes[j] ^= (codes[j] ^ (how | layer[j - move])) & better;
        }
    }

    void write(std::uint8_t *out) const {
        for (std::size_t j = 0; j < code.size(); ++j) out[j] = static_cast<std::uint8_t>(code[j]);
    }
};

constexpr float nowhere = -1e30f;  // worse than any path, yet finite

void graph(Rows evidence, Moves moves, float hidden, float surface, float jump, State state,
           Codes codes, Index peaks, Index best) {
    const std::size_t n_rows = evidence.shape(0), n = evidence.shape(1);
    const float *rows = evidence.data();
    float *matching = state.data(), *hiding = matching + n;
    std::uint8_t *code = codes.data();
    std::int64_t *peak = peaks.data(), *winner = best.data();
    nb::gil_scoped_release released;
    Origins surfacing(n), diving(n);
    Arrivals matched(n), hid(n);
    for (std::size_t i = 0; i < n_rows; ++i, rows += n, code += 2 * n) {
        surfacing.choose(matching, hiding, surface);
        diving.choose(matching, hiding, 0.0f);
        const auto top = std::max_element(diving.value.begin(), diving.value.end());
        const std::size_t at = top - diving.value.begin();
        peak[i] = static_cast<std::int64_t>(at);
        matched.fill(nowhere, 0);
        hid.fill(*top - jump, jumped | diving.layer[at]);
        for (std::size_t m = 0; m < moves.shape(0); ++m) {
            matched.offer(surfacing, moves.data()[m], static_cast<std::int32_t>(m));
            hid.offer(diving, moves.data()[m], static_cast<std::int32_t>(m));
        }
        matched.write(code);
        hid.write(code + n);
        for (std::size_t j = 0; j < n; ++j) {
            matching[j] = matched.value[j] + rows[j];
            hiding[j] = hid.value[j] + hidden;
        }
        const std::size_t end = std::max_element(matching, matching + 2 * n) - matching;
        winner[i] = static_cast<std::int64_t>(end);
        const float highest = matching[end];
        for (std::size_t j = 0; j < 2 * n; ++j) matching[j] -= highest;
    }
}

} // namespace

void bind_graph(nb::module_ &module) {
    module.def("graph", &graph, "evidence"_a.noconvert(), "moves"_a.noconvert(), "hidden"_a,
               "surface"_a, "jump"_a, "state"_a.noconvert(), "codes"_a.noconvert(),
               "peaks"_a.noconvert(), "best"_a.noconvert());
}
