// Mutual nearest keypoints, written once for vectors of any size.
//
// Counting bits word by word would take most of the time. Carry-save adders turn the 16 words of a
// pair into five whose bits count 1, 2, 4, 8 and 16 (Harley and Seal; see Warren, Hacker's
// Delight, section 5-1), so that five words are counted in place of sixteen.
//
// Everything lies in an unnamed namespace: each file compiles its own, with its own flags.
#pragma once

#include "keypoints_kernel.h"

namespace retraverse {
namespace {

template <int bytes> struct Lanes {
    typedef std::uint16_t Words __attribute__((vector_size(bytes)));
    typedef std::int16_t Numbers __attribute__((vector_size(bytes)));
    static constexpr std::size_t count = bytes / 2;

    template <class Vector, class Value> static void load(Vector &vector, const Value *address) {
        __builtin_memcpy(&vector, address, sizeof vector);
    }
    template <class Vector, class Value> static void store(Value *address, const Vector &vector) {
        __builtin_memcpy(address, &vector, sizeof vector);
    }

    // sum = the low bit of a + b + c, carry = the high one, for each bit.
    static void add(Words &sum, Words &carry, const Words &a, const Words &b, const Words &c) {
        const Words differ = a ^ b;
        carry = (a & b) | (differ & c);
        sum = differ ^ c;
    }

    // Each byte becomes the number of its bits.
    static void count_bits(Words &x) {
        x -= (x >> 1) & 0x5555;
        x = (x & 0x3333) + ((x >> 2) & 0x3333);
        x = (x + (x >> 4)) & 0x0f0f;
    }

    // How many bits of one query keypoint differ from those of `count` reference keypoints.
    static void distances(Numbers &distance, const Words *query, const std::uint16_t *reference) {
        Words ones{}, twos{}, fours{}, eights{}, sixteens{};
        Words two[2], four[2], eight[2];
        for (int half = 0; half < 2; ++half) {
            for (int quarter = 0; quarter < 2; ++quarter) {
                for (int pair = 0; pair < 2; ++pair) {
                    const int word = 8 * half + 4 * quarter + 2 * pair;
                    Words x, y;
                    load(x, reference + word * count);
                    load(y, reference + (word + 1) * count);
                    add(ones, two[pair], ones, x ^ query[word], y ^ query[word + 1]);
                }
                add(twos, four[quarter], twos, two[0], two[1]);
            }
            add(fours, eight[half], fours, four[0], four[1]);
        }
        add(eights, sixteens, eights, eight[0], eight[1]);
        count_bits(ones), count_bits(twos), count_bits(fours);
        count_bits(eights), count_bits(sixteens);
        const Words sum =
            ones + (twos << 1) + (fours << 2) + (eights << 3) + (sixteens << 4);
        distance = (Numbers)((sum & 0xff) + (sum >> 8));
    }

    // The lowest (distance, index) over the lanes of what one query keypoint met.
    static int nearest_of(const Numbers &bests, const Numbers &blocks, int max_distance) {
        std::int16_t best[count], block[count];
        store(best, bests);
        store(block, blocks);
        int lowest = max_distance + 1, index = -1;
        for (std::size_t lane = 0; lane < count; ++lane) {
            const int found = block[lane] * int(count) + int(lane);
            if (best[lane] < lowest || (best[lane] == lowest && index >= 0 && found < index)) {
                lowest = best[lane];
                index = found;
            }
        }
        return index;
    }

    static int matches(const std::uint8_t *query, std::size_t n_query, std::size_t blocks,
                       int max_distance, const KeypointScratch &scratch) {
        for (std::size_t j = 0; j < blocks * count; ++j)
            scratch.best[j] = too_far;
        for (std::size_t q = 0; q < n_query; ++q) {
            std::uint16_t words[keypoint_words];
            __builtin_memcpy(words, query + q * keypoint_bytes, sizeof words);
            Words spread[keypoint_words];
            for (std::size_t word = 0; word < keypoint_words; ++word)
                spread[word] = Words{} + words[word];
            Numbers row_best = Numbers{} + too_far, row_block{};
            const Numbers number = Numbers{} + static_cast<std::int16_t>(q);
            for (std::size_t block = 0; block < blocks; ++block) {
                const std::size_t first = block * count;
                Numbers distance, beyond, best, who;
                distances(distance, spread, scratch.reference + first * keypoint_words);
                load(beyond, scratch.out_of_bounds + first);
                distance += beyond;
                load(best, scratch.best + first);
                load(who, scratch.who + first);
                const Numbers closer = distance < best;
                store(scratch.best + first, closer ? distance : best);
                store(scratch.who + first, closer ? number : who);
                const Numbers closer_in_row = distance < row_best;
                row_best = closer_in_row ? distance : row_best;
                row_block =
                    closer_in_row ? Numbers{} + static_cast<std::int16_t>(block) : row_block;
            }
            scratch.nearest[q] =
                static_cast<std::int16_t>(nearest_of(row_best, row_block, max_distance));
        }
        int mutual = 0;
        for (std::size_t q = 0; q < n_query; ++q) {
            const int reference = scratch.nearest[q];
            mutual += reference >= 0 && scratch.who[reference] == static_cast<int>(q);
        }
        return mutual;
    }
};

} // namespace
} // namespace retraverse
