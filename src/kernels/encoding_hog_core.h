// The body of the cell histograms, included once per instruction set after RETRAVERSE_HOG_NAMESPACE
// is defined. It includes no header that defines inline functions and calls none: the linker
// would keep one copy for all files, perhaps the one an older processor cannot run.
//
// Filters run on 32-bit integers. The gamma table is in units of 2^-16 grey level, so a sum over
// the 5x5 Sobel kernel stays below 255 * 2^16 * 48 < 2^30, is exact, and is the same on every
// processor; a flat or a mirror-symmetric patch has magnitude 0, not rounding noise that the
// block norm would blow up to a unit vector.

namespace retraverse {
namespace RETRAVERSE_HOG_NAMESPACE {
namespace {

// One picture row: gamma, mirrored margins (cb|abcd|cb), then both horizontal Sobel parts.
void filter_row(const std::uint8_t *__restrict row, const std::int32_t *__restrict gamma, int size,
                std::int32_t *__restrict padded, std::int32_t *__restrict smooth,
                std::int32_t *__restrict slope) {
    std::int32_t *g = padded + 2;
    for (int x = 0; x < size; ++x) g[x] = gamma[row[x]];
    g[-1] = g[1];
    g[-2] = g[2];
    g[size] = g[size - 2];
    g[size + 1] = g[size - 3];
    for (int x = 0; x < size; ++x) {
        const std::int32_t a = padded[x], b = padded[x + 1], c = padded[x + 2];
        const std::int32_t d = padded[x + 3], e = padded[x + 4];
        smooth[x] = a + e + 4 * (b + d) + 6 * c;
        slope[x] = (e - a) + 2 * (d - b);
    }
}

// Five filtered rows around the current one, already mirrored at the picture's edges.
struct Rows {
    const std::int32_t *smooth[5];
    const std::int32_t *slope[5];
};

// atan(t) / (2 pi) for t in [0, 1], within 6e-9: an odd polynomial fitted for the least
// greatest error on that interval.
inline float turns_of_tangent(float t) {
    const float u = t * t;
    float p = -6.453042241e-04f;
    p = p * u + 3.479597111e-03f;
    p = p * u - 8.898722140e-03f;
    p = p * u + 1.534603288e-02f;
    p = p * u - 2.213627113e-02f;
    p = p * u + 3.174594515e-02f;
    p = p * u - 5.304612096e-02f;
    p = p * u + 1.591548373e-01f;
    return p * t;
}

// Direction of (dx, dy) in turns, [0, 1], anticlockwise from +x; 0 where there is no gradient.
inline float turns_of_gradient(float dx, float dy) {
    const float ax = __builtin_fabsf(dx), ay = __builtin_fabsf(dy);
    const float longer = ax > ay ? ax : ay, shorter = ax > ay ? ay : ax;
    const float octant = turns_of_tangent(shorter / (longer > 1.0f ? longer : 1.0f));
    const float quadrant = ay > ax ? 0.25f - octant : octant;
    const float half = dx < 0.0f ? 0.5f - quadrant : quadrant;
    return dy < 0.0f ? 1.0f - half : half;
}

// Magnitude of every pixel of a row, and its angle in bins, [0, bins].
template <bool is_signed, bool is_euclidean>
void gradients(const Rows &rows, int size, int bins, float *__restrict magnitude,
               float *__restrict position) {
    const std::int32_t *__restrict s0 = rows.smooth[0], *__restrict s1 = rows.smooth[1];
    const std::int32_t *__restrict s3 = rows.smooth[3], *__restrict s4 = rows.smooth[4];
    const std::int32_t *__restrict d0 = rows.slope[0], *__restrict d1 = rows.slope[1];
    const std::int32_t *__restrict d2 = rows.slope[2], *__restrict d3 = rows.slope[3];
    const std::int32_t *__restrict d4 = rows.slope[4];
    const float width = static_cast<float>(bins);
    const float bins_per_turn = is_signed ? width : 2.0f * width;
    for (int x = 0; x < size; ++x) {
        const std::int32_t dx = d0[x] + d4[x] + 4 * (d1[x] + d3[x]) + 6 * d2[x];
        const std::int32_t dy = (s4[x] - s0[x]) + 2 * (s3[x] - s1[x]);
        const float fx = static_cast<float>(dx), fy = static_cast<float>(dy);
        if (is_euclidean) {
            magnitude[x] = __builtin_sqrtf(fx * fx + fy * fy);
        } else {
            magnitude[x] = __builtin_fabsf(static_cast<float>(dx + dy));
        }
        const float place = turns_of_gradient(fx, fy) * bins_per_turn;
        position[x] = !is_signed && place >= width ? place - width : place;
    }
}

using Gradients = void (*)(const Rows &, int, int, float *, float *);

Gradients gradients_for(const HogShape &shape) {
    if (shape.is_signed) return shape.is_euclidean ? gradients<true, true> : gradients<true, false>;
    return shape.is_euclidean ? gradients<false, true> : gradients<false, false>;
}

// Linear votes into the two nearest bins, written as a tent around each bin: no scatter, and
// every pixel column keeps its own sums until the row of cells is complete.
void vote(const float *__restrict magnitude, const float *__restrict position, int size, int bins,
          float *__restrict votes) {
    const float last = static_cast<float>(bins - 1);
    for (int x = 0; x < size; ++x) {  // bin 0 also takes the way round from the last one
        const float left = 1.0f - position[x], right = position[x] - last;
        votes[x] += magnitude[x] * ((left > 0.0f ? left : 0.0f) + (right > 0.0f ? right : 0.0f));
    }
    for (int bin = 1; bin < bins; ++bin) {
        float *__restrict sums = votes + static_cast<std::size_t>(bin) * size;
        const float centre = static_cast<float>(bin);
        for (int x = 0; x < size; ++x) {
            const float share = 1.0f - __builtin_fabsf(position[x] - centre);
            sums[x] += magnitude[x] * (share > 0.0f ? share : 0.0f);
        }
    }
}

// Adds up the columns of each cell into histograms[cell][bin], and clears the votes.
void close_cells(const HogShape &shape, float *__restrict votes, float *__restrict histograms) {
    const int n_cells = shape.size / shape.cell;
    for (int bin = 0; bin < shape.bins; ++bin) {
        float *sums = votes + static_cast<std::size_t>(bin) * shape.size;
        for (int c = 0; c < n_cells; ++c) {
            float total = 0.0f;
            for (int x = 0; x < shape.cell; ++x) total += sums[c * shape.cell + x];
            histograms[c * shape.bins + bin] = total;
        }
        for (int x = 0; x < shape.size; ++x) sums[x] = 0.0f;
    }
}

int mirrored(int row, int size) {
    if (row < 0) return -row;
    return row < size ? row : 2 * size - 2 - row;
}

} // namespace

void cell_histograms(const std::uint8_t *grey, const std::int32_t *gamma, const HogShape &shape,
                     std::int32_t *scratch, float *histograms) {
    const int size = shape.size, n_cells = size / shape.cell;
    // The row with margins comes last: before it all rows stay aligned.
    std::int32_t *smooth = scratch, *slope = smooth + 5 * size;
    std::int32_t *padded = slope + (7 + shape.bins) * size;
    float *magnitude = reinterpret_cast<float *>(slope + 5 * size);
    float *position = magnitude + size, *votes = position + size;
    for (int i = 0; i < shape.bins * size; ++i) votes[i] = 0.0f;
    const Gradients row_gradients = gradients_for(shape);
    for (int y = 0, ready = 0; y < size; ++y) {
        for (; ready < size && ready <= y + 2; ++ready) {
            const int slot = ready % 5 * size;
            filter_row(grey + static_cast<std::size_t>(ready) * size, gamma, size, padded,
                       smooth + slot, slope + slot);
        }
        Rows rows;
        for (int k = 0; k < 5; ++k) {
            const int slot = mirrored(y + k - 2, size) % 5 * size;
            rows.smooth[k] = smooth + slot;
            rows.slope[k] = slope + slot;
        }
        row_gradients(rows, size, shape.bins, magnitude, position);
        vote(magnitude, position, size, shape.bins, votes);
        if ((y + 1) % shape.cell == 0) {
            close_cells(shape, votes, histograms);
            histograms += static_cast<std::size_t>(n_cells) * shape.bins;
        }
    }
}

} // namespace RETRAVERSE_HOG_NAMESPACE
} // namespace retraverse
