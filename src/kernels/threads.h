// A loop over independent items on several threads, without a pool that could outlive a fork.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <system_error>
#include <thread>
#include <vector>

namespace retraverse {

// How many threads are worth starting: each must have at least `least` of `work` to do, since
// starting one costs some 20 microseconds.
inline unsigned worthwhile_threads(unsigned threads, double work, double least) {
    const double useful = std::max(1.0, work / least);
    return useful < threads ? static_cast<unsigned>(useful) : std::max(1u, threads);
}

// Call body(item, worker) for every item in [0, count), on at most `threads` threads, the caller
// being one of them. `worker` in [0, threads) names the thread, for scratch memory of its own.
//
// Threads take the next item as they become free, so a slow core does not hold up the rest. The
// result is the same on any number of threads as long as an item writes only what is its own.
// `body` must not throw. Where the system refuses a thread the others do its share.
template <class Body> void parallel_for(std::size_t count, unsigned threads, const Body &body) {
    std::atomic<std::size_t> next{0};
    const auto work = [&](unsigned worker) {
        for (std::size_t item = next++; item < count; item = next++)
            body(item, worker);
    };
    std::vector<std::thread> helpers;
    const std::size_t wanted = std::min<std::size_t>(std::max(1u, threads), count);
    helpers.reserve(wanted);
    try {
        for (unsigned worker = 1; worker < wanted; ++worker)
            helpers.emplace_back(work, worker);
    } catch (const std::system_error &) {
    }
    work(0);
    for (std::thread &helper : helpers)
        helper.join();
}

} // namespace retraverse
