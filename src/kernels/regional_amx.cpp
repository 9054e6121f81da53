// Bytes on the matrix unit: sixteen reference regions by sixteen query regions by up to 64 values
// in one instruction. Both factors are unsigned, and both lie as the instruction wants them: the
// reference as in the map, the query as packed for the vector kernels.
#include "regional_kernel.h"

#include <immintrin.h>

namespace {

using retraverse::Form;
using retraverse::RegionalKernel;
using std::size_t;
using std::uint32_t;
using std::uint8_t;

constexpr size_t side = 16;             // rows and columns of a tile of sums
constexpr size_t block_rows = 2 * side; // reference regions in one block of 2 x 2 tiles
constexpr size_t line = 64;             // bytes in a row of a tile
constexpr size_t tile_words = side * side;
constexpr size_t deepest = 16;          // words of depth that a tile holds

// Tiles 0..3 hold sums (2 reference x 2 query), 4 and 5 the reference, 6 and 7 the query.
void configure(size_t depth) {
    struct alignas(64) {
        uint8_t palette = 1, start_row = 0, reserved[14] = {};
        uint16_t bytes_per_row[16] = {};
        uint8_t rows[16] = {};
    } config;
    for (int t = 0; t < 8; ++t) {
        const bool reference = t == 4 || t == 5, query = t >= 6;
        config.rows[t] = static_cast<uint8_t>(query ? depth : side);
        config.bytes_per_row[t] = static_cast<uint16_t>(reference ? 4 * depth : line);
    }
    _tile_loadconfig(&config);
}

// What is under way in one panel of the query: 16 * Width of its regions.
struct Panel {
    const uint8_t *query, *reference;
    size_t steps, depth;
    __m512i best[2] = {_mm512_setzero_si512(), _mm512_setzero_si512()};
    alignas(line) std::int32_t sums[4][tile_words] = {};
};

// The operations of tile T of sums. A macro, since the intrinsics take registers as literals only.
template <int T> struct Tile;
#define TILE(T, REFERENCE, QUERY)                                                                  \
    template <> struct Tile<T> {                                                                   \
        static void clear() { _tile_zero(T); }                                                     \
        static void store(std::int32_t *sums) { _tile_stored(T, sums, line); }                     \
        static void multiply() { _tile_dpbuud(T, REFERENCE, QUERY); }                              \
        static void load_reference(const uint8_t *start, size_t row_bytes) {                       \
            _tile_loadd(REFERENCE, start, row_bytes);                                              \
        }                                                                                          \
        static void load_query(const uint8_t *start, size_t row_bytes) {                           \
            _tile_loadd(QUERY, start, row_bytes);                                                  \
        }                                                                                          \
    };
TILE(0, 4, 6)
TILE(1, 4, 7)
TILE(2, 5, 6)
TILE(3, 5, 7)
#undef TILE

// Tile T of sums starts anew with the block of reference regions that begins at `row`.
template <int T, int Width, bool Deep>
inline __attribute__((always_inline)) void multiply(const Panel &panel, size_t row) {
    constexpr int column = T % 2;
    const size_t row_bytes = 4 * panel.steps;
    const uint8_t *reference = panel.reference + (row + T / 2 * side) * row_bytes;
    Tile<T>::clear();
    if (!Deep) {
        if (column == 0)
            Tile<T>::load_reference(reference, row_bytes);
        Tile<T>::multiply();
        return;
    }
    for (size_t s = 0; s < panel.steps; s += panel.depth) {
        Tile<T>::load_reference(reference + 4 * s, row_bytes);
        Tile<T>::load_query(panel.query + (s * Width + column) * line, Width * line);
        Tile<T>::multiply();
    }
}

template <int T> inline __attribute__((always_inline)) void keep_larger(Panel &panel) {
    __m512i larger = panel.best[T % 2];
    for (size_t row = 0; row < side; ++row) {
        const __m512i sums = _mm512_load_si512(panel.sums[T] + row * side);
        larger = _mm512_mask_max_epi32(larger, 0xffff, larger, sums);
    }
    panel.best[T % 2] = larger;
}

// Three blocks are under way in each tile's turn: the last but one is looked through in memory, the
// last takes its place there, the next is started. In any other order the vector units' loads wait
// for the tiles' stores, and it takes half as long again.
template <int T, int Width, bool Deep>
inline __attribute__((always_inline)) void turn(Panel &panel, size_t row) {
    keep_larger<T>(panel);
    Tile<T>::store(panel.sums[T]);
    multiply<T, Width, Deep>(panel, row);
}

template <int T> inline __attribute__((always_inline)) void finish(Panel &panel) {
    keep_larger<T>(panel);
    Tile<T>::store(panel.sums[T]);
    keep_larger<T>(panel);
}

template <int Width, bool Deep>
void match_panel(const uint8_t *query, const uint8_t *reference, size_t rows, size_t steps,
                 size_t depth, std::int32_t *best) {
    Panel panel{query, reference, steps, depth};
    Tile<0>::clear();
    Tile<1>::clear();
    Tile<2>::clear();
    Tile<3>::clear();
    if (!Deep) {
        Tile<0>::load_query(query, Width * line);
        if (Width == 2)
            Tile<1>::load_query(query + line, Width * line);
    }
    for (size_t row = 0; row < rows; row += block_rows) {
        // The last block starts early: a region seen twice does not change a maximum.
        const size_t first = row + block_rows <= rows ? row : rows - block_rows;
        turn<0, Width, Deep>(panel, first);
        if (Width == 2)
            turn<1, Width, Deep>(panel, first);
        turn<2, Width, Deep>(panel, first);
        if (Width == 2)
            turn<3, Width, Deep>(panel, first);
    }
    finish<0>(panel);
    finish<1>(panel);
    finish<2>(panel);
    finish<3>(panel);
    for (int v = 0; v < Width; ++v)
        _mm512_storeu_si512(best + v * side, panel.best[v]);
}

template <bool Deep>
void match_panels(const uint8_t *query, size_t vectors, const uint8_t *reference, size_t rows,
                  size_t steps, size_t depth, std::int32_t *best) {
    for (; vectors >= 2; vectors -= 2, query += 2 * steps * line, best += 2 * side)
        match_panel<2, Deep>(query, reference, rows, steps, depth, best);
    if (vectors)
        match_panel<1, Deep>(query, reference, rows, steps, depth, best);
}

void best_matches(const void *query, size_t vectors, const void *reference, size_t rows,
                  size_t steps, void *best) {
    const size_t depth = steps < deepest ? steps : deepest;
    const auto match = steps > deepest ? match_panels<true> : match_panels<false>;
    configure(depth);
    match(static_cast<const uint8_t *>(query), vectors, static_cast<const uint8_t *>(reference),
          rows, steps, depth, static_cast<std::int32_t *>(best));
    _tile_release();
}

} // namespace

namespace retraverse {

const RegionalKernel regional_uint8_amx = {
    Form::bytes, side, 2, block_rows, deepest, best_matches, weigh_avx512, nullptr};

} // namespace retraverse
