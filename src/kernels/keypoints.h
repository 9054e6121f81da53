// How many binary keypoint descriptors of two pictures are each other's nearest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace retraverse {

struct KeypointProblem {
    const std::uint8_t *queries;           // (n_queries, query_slots, 32)
    const std::int32_t *query_counts;      // (n_queries): how many slots are taken, from the first
    const std::uint8_t *references;        // (n_references, reference_slots, 32)
    const std::int32_t *reference_counts;  // (n_references)
    std::int32_t *out;                     // (n_queries, n_references)
    std::size_t n_queries, query_slots, n_references, reference_slots;
    int max_distance;                      // pairs further apart are no matches
};

// Solve on `threads` threads with the newest kernel up to `instruction_set` ("" = the newest here).
// Throws std::invalid_argument for an instruction set that cannot run here.
void keypoint_matches(const KeypointProblem &problem, unsigned threads,
                      const std::string &instruction_set);

} // namespace retraverse
