#include "keypoints.h"

#include "cpu.h"
#include "keypoints_kernel.h"
#include "threads.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

namespace retraverse {

namespace {

const KeypointKernel &kernel_up_to(const std::string &newest) {
    for (InstructionSet set : newest.empty() ? instruction_sets() : instruction_sets_up_to(newest))
        switch (set) {
#if defined(__x86_64__)
        case InstructionSet::avx2: return keypoints_avx2;
        case InstructionSet::avx512: return keypoints_avx512;
#endif
        default: break;
        }
    return keypoints_plain;
}

// One worker's memory: what `KeypointScratch` points at.
class Memory {
  public:
    Memory(std::size_t lanes, std::size_t reference_slots, std::size_t query_slots) : lanes_(lanes) {
        const std::size_t slots = rounded_up(reference_slots, lanes);
        const std::size_t sizes[] = {slots * keypoint_words, slots, slots, slots, query_slots};
        std::size_t total = line;
        for (std::size_t size : sizes)
            total += rounded_up(size, line);
        bytes_.resize(2 * total);
        void *start = bytes_.data();
        std::size_t space = bytes_.size();
        auto *next = static_cast<std::int16_t *>(std::align(2 * line, 2, start, space));
        std::int16_t *parts[5];
        for (std::size_t i = 0; i < 5; ++i) {
            parts[i] = next;
            next += rounded_up(sizes[i], line);
        }
        scratch = {reinterpret_cast<std::uint16_t *>(parts[0]), parts[1], parts[2], parts[3],
                   parts[4]};
    }

    // Bring a reference into the kernel's order; returns how many blocks of lanes it fills.
    std::size_t pack(const std::uint8_t *descriptors, std::size_t count) {
        const std::size_t blocks = rounded_up(count, lanes_) / lanes_;
        for (std::size_t j = 0; j < blocks * lanes_; ++j) {
            std::uint16_t words[keypoint_words] = {};
            if (j < count)
                std::memcpy(words, descriptors + j * keypoint_bytes, sizeof words);
            for (std::size_t word = 0; word < keypoint_words; ++word)
                scratch.reference[(j / lanes_ * keypoint_words + word) * lanes_ + j % lanes_] =
                    words[word];
            scratch.out_of_bounds[j] = j < count ? 0 : too_far;
        }
        return blocks;
    }

    KeypointScratch scratch{};

  private:
    static constexpr std::size_t line = 32; // words of 16 bits
    static std::size_t rounded_up(std::size_t value, std::size_t multiple) {
        return (value + multiple - 1) / multiple * multiple;
    }
    std::size_t lanes_;
    std::vector<unsigned char> bytes_;
};

} // namespace

void keypoint_matches(const KeypointProblem &problem, unsigned threads,
                      const std::string &instruction_set) {
    const KeypointKernel &kernel = kernel_up_to(instruction_set);
    const std::size_t slots = problem.reference_slots, R = problem.n_references;
    const double work = 1.0 * problem.n_queries * problem.query_slots * slots * R;
    threads = worthwhile_threads(threads, work, 1e6);
    std::vector<std::unique_ptr<Memory>> memory;
    for (unsigned worker = 0; worker < threads; ++worker)
        memory.push_back(std::make_unique<Memory>(kernel.lanes, slots, problem.query_slots));
    parallel_for(R, threads, [&](std::size_t r, unsigned worker) {
        Memory &mine = *memory[worker];
        const std::size_t blocks = mine.pack(
            problem.references + r * slots * keypoint_bytes, problem.reference_counts[r]);
        for (std::size_t q = 0; q < problem.n_queries; ++q)
            problem.out[q * R + r] = kernel.matches(
                problem.queries + q * problem.query_slots * keypoint_bytes,
                problem.query_counts[q], blocks, problem.max_distance, mine.scratch);
    });
}

} // namespace retraverse
