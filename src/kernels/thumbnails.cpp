#include "thumbnails.h"

#include "cpu.h"
#include "threads.h"

#include <algorithm>

namespace retraverse {

namespace {

const ThumbnailKernel &kernel_up_to(const std::string &newest) {
    for (InstructionSet set : newest.empty() ? instruction_sets() : instruction_sets_up_to(newest))
        switch (set) {
#if defined(__x86_64__)
        case InstructionSet::avx2: return thumbnails_avx2;
        case InstructionSet::avx512: return thumbnails_avx512;
#elif defined(__aarch64__)
        case InstructionSet::neon: return thumbnails_neon;
#endif
        default: break;
        }
    return thumbnails_plain;
}

} // namespace

void thumbnail_differences(const ThumbnailProblem &problem, unsigned threads,
                           const std::string &instruction_set) {
    const ThumbnailKernel &kernel = kernel_up_to(instruction_set);
    const auto row =
        problem.difference == Difference::absolute ? kernel.absolute : kernel.saturating;
    const std::size_t length = problem.length, R = problem.n_references;
    constexpr std::size_t tile_bytes = 256 * 1024;
    const std::size_t tile = std::max<std::size_t>(4, tile_bytes / std::max<std::size_t>(1, length));
    const double work = 1.0 * problem.n_queries * R * length;
    parallel_for((R + tile - 1) / tile, worthwhile_threads(threads, work, 2e6),
                 [&](std::size_t item, unsigned) {
                     const std::size_t first = item * tile, count = std::min(tile, R - first);
                     for (std::size_t q = 0; q < problem.n_queries; ++q)
                         row(problem.queries + q * length, problem.references + first * length,
                             count, length, problem.out + q * R + first);
                 });
}

} // namespace retraverse
