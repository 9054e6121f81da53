// Hidden Markov models over the frames of a map and one state more, "not in the map".
//
// From frame r of the map the camera moves to r + move with probability moves[move], or jumps
// to any frame, or leaves; from outside it stays there or enters at any frame. A state is an array
// of R + 1: the map's frames, then outside. All functions go on from a state given, so that a
// drive may come a block of rows at a time, or row by row.
#include "bindings.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using RowsOut = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using State = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Weights = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Moves = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Codes = nb::ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Index = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr std::int32_t jumped = 254, entered = 255;

// The columns r of which r - move lies in the map too.
struct Reach {
    std::int64_t first, end;
    Reach(std::int64_t move, std::size_t n)
        : first(std::max<std::int64_t>(move, 0)),
          end(static_cast<std::int64_t>(n) + std::min<std::int64_t>(move, 0)) {}
};

std::size_t first_largest(const float *values, std::size_t n) {
    constexpr std::size_t lanes = 8;  // independent maxima, so that the compiler uses vectors
    float best[lanes];
    std::fill(best, best + lanes, -std::numeric_limits<float>::infinity());
    std::size_t j = 0;
    for (; j + lanes <= n; j += lanes)
        for (std::size_t k = 0; k < lanes; ++k)
            best[k] = values[j + k] > best[k] ? values[j + k] : best[k];
    float top = *std::max_element(best, best + lanes);
    for (; j < n; ++j) top = std::max(top, values[j]);
    return std::find(values, values + n, top) - values;
}

struct Candidates {
    std::vector<float> value;
    std::vector<std::int32_t> code;
    explicit Candidates(std::size_t n) : value(n), code(n) {}

    void fill(float far, std::int32_t how) {
        std::fill(value.begin(), value.end(), far);
        std::fill(code.begin(), code.end(), how);
    }

    // Takes arrivals from `move` frames away wherever they are better than what is known.
    void offer(const float *__restrict from, std::int64_t move, float weight, std::int32_t how) {
        const Reach reach(move, value.size());
        float *__restrict best = value.data();
        std::int32_t *__restrict codes = code.data();
        for (std::int64_t j = reach.first; j < reach.end; ++j) {
            const float arriving = from[j - move] + weight, known = best[j];
            // A mask, not a condition: the compiler would make it a branch and use no vectors.
            const std::int32_t better = -static_cast<std::int32_t>(arriving > known);
            best[j] = arriving > known ? arriving : known;
            codes[j] ^= (codes[j] ^ how) & better;
        }
    }
};

// Log probabilities of the four ways that are no move within reach.
struct Ways {
    float jump, enter, leave, stay_outside;
};

// One row of Viterbi: `state` (n + 1) becomes that of the next frame, less its maximum.
void viterbi_row(const float *evidence, std::size_t n, Moves moves, Weights log_moves,
                 const Ways &ways, float *state, Candidates &best, std::uint8_t *pointers,
                 std::int64_t &peak, std::int64_t &outside_from) {
    peak = static_cast<std::int64_t>(first_largest(state, n));
    const float jumping = state[peak] + ways.jump, entering = state[n] + ways.enter;
    best.fill(std::max(jumping, entering), entering > jumping ? entered : jumped);
    for (std::size_t m = 0; m < moves.shape(0); ++m)
        best.offer(state, moves.data()[m], log_moves.data()[m], static_cast<std::int32_t>(m));
    const float staying = state[n] + ways.stay_outside, leaving = state[peak] + ways.leave;
    outside_from = leaving > staying ? peak : -1;
    state[n] = std::max(staying, leaving);
    for (std::size_t j = 0; j < n; ++j) {
        state[j] = best.value[j] + evidence[j];
        pointers[j] = static_cast<std::uint8_t>(best.code[j]);
    }
}

// Subtracts the maximum of all n + 1 states; returns the best one's frame, or -1 for outside.
std::int64_t settle(float *state, std::size_t n) {
    const std::size_t peak = first_largest(state, n);
    const bool outside = state[n] >= state[peak];
    const float top = outside ? state[n] : state[peak];
    for (std::size_t j = 0; j <= n; ++j) state[j] -= top;
    return outside ? -1 : static_cast<std::int64_t>(peak);
}

void viterbi(Rows evidence, Moves moves, Weights log_moves, float jump, float enter, float leave,
             float stay_outside, State state, Codes pointers, Index peaks, Index outside_from,
             Index best) {
    const std::size_t n_rows = evidence.shape(0), n = evidence.shape(1);
    const Ways ways{jump, enter, leave, stay_outside};
    const float *rows = evidence.data();
    float *states = state.data();
    std::uint8_t *codes = pointers.data();
    std::int64_t *peak = peaks.data(), *from = outside_from.data(), *winner = best.data();
    nb::gil_scoped_release released;
    Candidates candidates(n);
    for (std::size_t i = 0; i < n_rows; ++i) {
        viterbi_row(rows + i * n, n, moves, log_moves, ways, states, candidates, codes + i * n,
                    peak[i], from[i]);
        winner[i] = settle(states, n);
    }
}

// out[r] = sum over moves of weight * from[r - sign * move].
void spread(const float *__restrict from, std::size_t n, Moves moves, Weights weights,
            std::int64_t sign, float everywhere, float *__restrict out) {
    std::fill(out, out + n, everywhere);
    for (std::size_t m = 0; m < moves.shape(0); ++m) {
        const std::int64_t move = sign * moves.data()[m];
        const float weight = weights.data()[m];
        const Reach reach(move, n);
        for (std::int64_t j = reach.first; j < reach.end; ++j) out[j] += weight * from[j - move];
    }
}

double sum(const float *values, std::size_t n) {
    constexpr std::size_t lanes = 8;
    double part[lanes] = {};
    std::size_t j = 0;
    for (; j + lanes <= n; j += lanes)
        for (std::size_t k = 0; k < lanes; ++k) part[k] += values[j + k];
    for (; j < n; ++j) part[0] += values[j];
    double total = 0;
    for (double each : part) total += each;
    return total;
}

void scale(float *values, std::size_t n, double factor) {
    const auto by = static_cast<float>(factor);
    for (std::size_t j = 0; j < n; ++j) values[j] *= by;
}

// beliefs[i] = what is believed after row i, summing to 1; `state` is the belief before row 0 and
// becomes the last one.
void forward(Rows likelihood, Moves moves, Weights weights, float jump, float enter, float leave,
             State state, RowsOut beliefs) {
    const std::size_t n_rows = likelihood.shape(0), n = likelihood.shape(1);
    const float *rows = likelihood.data();
    float *before = state.data(), *out = beliefs.data();
    nb::gil_scoped_release released;
    for (std::size_t i = 0; i < n_rows; ++i, rows += n, out += n + 1) {
        const auto inside = static_cast<float>(sum(before, n));
        const float anywhere = (jump * inside + enter * before[n]) / static_cast<float>(n);
        spread(before, n, moves, weights, 1, anywhere, out);
        for (std::size_t j = 0; j < n; ++j) out[j] *= rows[j];
        out[n] = before[n] * (1 - enter) + inside * leave;
        scale(out, n + 1, 1 / sum(out, n + 1));
        std::copy(out, out + n + 1, before);
    }
}

// messages[i] = what the rows after row i say of each state at row i, summing to 1; rows are taken
// from last to first. `state` is the message of the last row and becomes that before row 0.
void backward(Rows likelihood, Moves moves, Weights weights, float jump, float enter, float leave,
              State state, RowsOut messages) {
    const std::size_t n_rows = likelihood.shape(0), n = likelihood.shape(1);
    const float *rows = likelihood.data();
    float *after = state.data(), *out = messages.data();
    nb::gil_scoped_release released;
    std::vector<float> seen(n);
    for (std::size_t i = n_rows; i-- > 0;) {
        std::copy(after, after + n + 1, out + i * (n + 1));
        for (std::size_t j = 0; j < n; ++j) seen[j] = rows[i * n + j] * after[j];
        const auto mean = static_cast<float>(sum(seen.data(), n) / static_cast<double>(n));
        const float outside = after[n];
        spread(seen.data(), n, moves, weights, -1, jump * mean + leave * outside, after);
        after[n] = enter * mean + (1 - enter) * outside;
        scale(after, n + 1, 1 / sum(after, n + 1));
    }
}

} // namespace

void bind_states(nb::module_ &module) {
    module.def("viterbi", &viterbi, "evidence"_a.noconvert(), "moves"_a.noconvert(),
               "log_moves"_a.noconvert(), "jump"_a, "enter"_a, "leave"_a, "stay_outside"_a,
               "state"_a.noconvert(), "pointers"_a.noconvert(), "peaks"_a.noconvert(),
               "outside_from"_a.noconvert(), "best"_a.noconvert());
    module.def("forward", &forward, "likelihood"_a.noconvert(), "moves"_a.noconvert(),
               "weights"_a.noconvert(), "jump"_a, "enter"_a, "leave"_a, "state"_a.noconvert(),
               "beliefs"_a.noconvert());
    module.def("backward", &backward, "likelihood"_a.noconvert(), "moves"_a.noconvert(),
               "weights"_a.noconvert(), "jump"_a, "enter"_a, "leave"_a, "state"_a.noconvert(),
               "messages"_a.noconvert());
}
