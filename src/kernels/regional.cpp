#include "regional.h"

#include "cpu.h"
#include "regional_kernel.h"
#include "threads.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <vector>

namespace retraverse {

namespace {

using Words = std::uint32_t;

const RegionalKernel *kernel_of(InstructionSet set, Element element) {
    const bool floats = element == Element::float32;
    switch (set) {
#if defined(__x86_64__)
    case InstructionSet::avx2: return floats ? &regional_float32_avx2 : &regional_uint8_avx2;
    case InstructionSet::avx512: return &regional_float32_avx512;
    case InstructionSet::vnni: return floats ? nullptr : &regional_uint8_vnni;
    case InstructionSet::amx: return floats ? nullptr : &regional_uint8_amx;
#elif defined(__aarch64__)
    case InstructionSet::neon: return &regional_float32_neon;
    case InstructionSet::neondot: return floats ? nullptr : &regional_uint8_neondot;
#endif
    case InstructionSet::plain: return &regional_float32_plain;
    default: return nullptr;
    }
}

const RegionalKernel &choose(const std::string &newest, Element element) {
    const auto &sets = newest.empty() ? instruction_sets() : instruction_sets_up_to(newest);
    for (InstructionSet set : sets)
        if (const RegionalKernel *kernel = kernel_of(set, element))
            return *kernel;
    return regional_float32_plain;
}

// Memory on the boundary of a cache line: a vector that straddles two costs two loads.
template <class T> class Aligned {
  public:
    explicit Aligned(std::size_t count) : bytes_(count * sizeof(T) + line) {
        void *start = bytes_.data();
        std::size_t space = bytes_.size();
        data_ = static_cast<T *>(std::align(line, count * sizeof(T), start, space));
    }
    T *data() { return data_; }
    const T *data() const { return data_; }
    T &operator[](std::size_t i) { return data_[i]; }

  private:
    static constexpr std::size_t line = 64;
    std::vector<unsigned char> bytes_;
    T *data_;
};

std::size_t rounded_up(std::size_t value, std::size_t multiple) {
    return (value + multiple - 1) / multiple * multiple;
}

std::size_t values_per_word(Form form) {
    return form == Form::floats ? 1 : form == Form::widened ? 2 : 4;
}

// The problem as one kernel sees it: sizes in words and vectors, the query packed, the weights of
// the regions that have any.
class Plan {
  public:
    Plan(const RegionalProblem &problem, const RegionalKernel &kernel)
        : problem(problem), kernel(kernel), used(used_regions(problem)),
          steps(steps_of(problem, kernel)),
          vectors((used.size() + kernel.lanes - 1) / kernel.lanes),
          count(rounded_up(vectors * kernel.lanes, 16)),
          rows(std::max(problem.regions, kernel.least_rows)),
          copies(!lies_ready(problem, kernel, steps)), query(vectors * kernel.lanes * steps),
          weights(problem.rows * count), lacking(count) {
        std::vector<Words> words(steps);
        for (std::size_t j = 0; j < used.size(); ++j)
            pack_region(j, words.data());
        for (std::size_t m = 0; m < problem.rows; ++m)
            for (std::size_t j = 0; j < used.size(); ++j)
                weights[m * count + j] = problem.weights[m * problem.query_regions + used[j]];
    }

    const RegionalProblem &problem;
    const RegionalKernel &kernel;
    const std::vector<std::size_t> used; // query regions that have a weight in some row
    const std::size_t steps, vectors;
    const std::size_t count; // query regions with padding
    const std::size_t rows;  // reference regions with padding
    const bool copies;       // a reference must be brought into the kernel's form
    Aligned<Words> query;
    Aligned<float> weights;
    std::vector<std::int32_t> lacking; // what Form::signed_reference took from each product

    // One reference in the kernel's form: where it lies, or copied to `scratch`.
    const void *reference(std::size_t r, Words *scratch) const {
        const std::size_t row_bytes = problem.length * value_bytes();
        const auto *all = static_cast<const unsigned char *>(problem.references);
        const auto *start = all + r * problem.regions * row_bytes;
        if (!copies)
            return start;
        for (std::size_t n = 0; n < rows; ++n) {
            const std::size_t source = std::min(n, problem.regions - 1);
            write_words(start + source * row_bytes, scratch + n * steps);
        }
        if (kernel.form == Form::signed_reference)
            for (std::size_t i = 0; i < rows * steps; ++i)
                scratch[i] ^= 0x80808080u;
        return scratch;
    }

  private:
    static std::vector<std::size_t> used_regions(const RegionalProblem &problem) {
        std::vector<char> has_weight(problem.query_regions);
        for (std::size_t m = 0; m < problem.rows; ++m)
            for (std::size_t g = 0; g < problem.query_regions; ++g)
                has_weight[g] |= problem.weights[m * problem.query_regions + g] != 0;
        std::vector<std::size_t> used;
        for (std::size_t g = 0; g < problem.query_regions; ++g)
            if (has_weight[g])
                used.push_back(g);
        return used;
    }

    static std::size_t steps_of(const RegionalProblem &problem, const RegionalKernel &kernel) {
        const std::size_t per_word = values_per_word(kernel.form);
        const std::size_t steps = (problem.length + per_word - 1) / per_word;
        return kernel.step_block && steps > kernel.step_block ? rounded_up(steps, kernel.step_block)
                                                              : steps;
    }

    // Whether the kernel can read the references where they lie.
    static bool lies_ready(const RegionalProblem &problem, const RegionalKernel &kernel,
                           std::size_t steps) {
        if (problem.regions < kernel.least_rows ||
            reinterpret_cast<std::uintptr_t>(problem.references) % sizeof(Words) != 0)
            return false;
        return problem.element == Element::float32 ||
               (kernel.form == Form::bytes && steps * sizeof(Words) == problem.length);
    }

    std::size_t value_bytes() const { return problem.element == Element::float32 ? 4 : 1; }

    // One descriptor in the kernel's words, zeros behind its end.
    void write_words(const unsigned char *row, Words *words) const {
        const std::size_t length = problem.length;
        if (problem.element == Element::float32 || values_per_word(kernel.form) == 4) {
            std::memcpy(words, row, length * value_bytes());
            std::memset(reinterpret_cast<unsigned char *>(words) + length * value_bytes(), 0,
                        steps * sizeof(Words) - length * value_bytes());
        } else if (kernel.form == Form::widened) {
            auto *wide = reinterpret_cast<std::uint16_t *>(words);
            wide[2 * steps - 1] = 0;
            for (std::size_t i = 0; i < length; ++i)
                wide[i] = row[i];
        } else {
            auto *floats = reinterpret_cast<float *>(words);
            for (std::size_t i = 0; i < length; ++i)
                floats[i] = row[i];
        }
    }

    void pack_region(std::size_t j, Words *words) {
        const std::size_t row_bytes = problem.length * value_bytes();
        const auto *row = static_cast<const unsigned char *>(problem.query) + used[j] * row_bytes;
        write_words(row, words);
        const std::size_t vector = j / kernel.lanes, first = vector / kernel.width * kernel.width;
        const std::size_t width = std::min(kernel.width, vectors - first);
        for (std::size_t s = 0; s < steps; ++s)
            query[(first * steps + s * width + vector - first) * kernel.lanes + j % kernel.lanes] =
                words[s];
        if (kernel.form == Form::signed_reference)
            for (std::size_t i = 0; i < problem.length; ++i)
                lacking[j] += 128 * row[i];
    }
};

struct Scratch {
    explicit Scratch(const Plan &plan)
        : reference(plan.copies ? plan.rows * plan.steps : 0), sums(plan.count), best(plan.count) {}
    Aligned<Words> reference;
    Aligned<std::int32_t> sums;
    Aligned<float> best;
};

void score_reference(const Plan &plan, std::size_t r, Scratch &scratch) {
    const RegionalProblem &problem = plan.problem;
    const RegionalKernel &kernel = plan.kernel;
    const bool floats = kernel.form == Form::floats;
    kernel.best_matches(plan.query.data(), plan.vectors,
                        plan.reference(r, scratch.reference.data()), plan.rows, plan.steps,
                        floats ? static_cast<void *>(scratch.best.data()) : scratch.sums.data());
    if (!floats)
        for (std::size_t g = 0; g < plan.count; ++g)
            scratch.best[g] = static_cast<float>(scratch.sums[g] + plan.lacking[g]);
    float *out = problem.out + r;
    kernel.weigh(scratch.best.data(), plan.weights.data(), problem.rows, plan.count, out,
                 problem.n_references);
    if (problem.element == Element::uint8)
        for (std::size_t m = 0; m < problem.rows; ++m)
            out[m * problem.n_references] /= 255.0f * 255.0f;
}

void keep_smaller(std::atomic<std::size_t> &smallest, std::size_t value) {
    std::size_t seen = smallest;
    while (value < seen && !smallest.compare_exchange_weak(seen, value)) {
    }
}

} // namespace

std::size_t regional_scores(const RegionalProblem &problem, unsigned threads,
                            const std::string &instruction_set) {
    const RegionalKernel &kernel = choose(instruction_set, problem.element);
    const Plan plan(problem, kernel);
    const std::size_t values = problem.regions * problem.length;
    const double work = 1.0 * problem.n_references * plan.used.size() * values;
    threads = worthwhile_threads(threads, work, 1e7);
    std::vector<Scratch> scratch;
    scratch.reserve(threads);
    for (unsigned worker = 0; worker < threads; ++worker)
        scratch.emplace_back(plan);
    std::atomic<std::size_t> first_bad{all_finite};
    parallel_for(problem.n_references, threads, [&](std::size_t r, unsigned worker) {
        const auto *floats = static_cast<const float *>(problem.references) + r * values;
        if (problem.element == Element::float32 && !kernel.is_finite(floats, values))
            keep_smaller(first_bad, r);
        else
            score_reference(plan, r, scratch[worker]);
    });
    return first_bad;
}

} // namespace retraverse
