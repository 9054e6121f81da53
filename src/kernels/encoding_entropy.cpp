// Entropy of the pixel values in a disk around each pixel.
//
// H = (N * log2(N) - sum over levels of n * log2(n)) / N: moving the disk by one pixel changes a few
// counts, and so the sum by a few table differences. The table is in fixed point, so the running
// sum is exact: it cannot drift along a row, and one level alone has entropy 0.
#include "encoding_entropy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

namespace retraverse {

namespace {

// The pixels of the disk x^2 + y^2 <= radius^2: half-width of each of its 2 * radius + 1 rows.
std::vector<int> disk_half_widths(int radius) {
    std::vector<int> half_widths;
    for (int y = -radius; y <= radius; ++y) {
        int x = 0;
        while ((x + 1) * (x + 1) + y * y <= radius * radius) ++x;
        half_widths.push_back(x);
    }
    return half_widths;
}

// n * log2(n) for n = 0..largest in whole units, and the steps from n to n + 1.
struct FixedPointTable {
    double unit;
    std::vector<std::int64_t> value, step;

    explicit FixedPointTable(int largest) {
        // The sum over levels never exceeds N * log2(N); 61 bits leave it room in 64.
        const double bound = std::max(2.0, largest * std::log2(static_cast<double>(largest)));
        unit = std::ldexp(1.0, static_cast<int>(std::ceil(std::log2(bound))) - 61);
        value.push_back(0);
        for (int n = 1; n <= largest; ++n) {
            value.push_back(std::llround(n * std::log2(static_cast<double>(n)) / unit));
            step.push_back(value[n] - value[n - 1]);
        }
    }
};

// The counts under the disk, their number N, and the running sum of n * log2(n).
class SlidingHistogram {
public:
    explicit SlidingHistogram(const std::int64_t *step) : step_(step) {}
    void add(std::uint8_t level) {
        sum_ += step_[counts_[level]++];
        ++size_;
    }
    void remove(std::uint8_t level) {
        sum_ -= step_[--counts_[level]];
        --size_;
    }
    // The disk moves one pixel on, all of it inside the picture: as many leave as enter.
    void slide(const std::uint8_t *at, const std::vector<std::ptrdiff_t> &leaving,
               const std::vector<std::ptrdiff_t> &entering) {
        std::int64_t sum = sum_;
        for (std::size_t k = 0; k < leaving.size(); ++k) {
            sum -= step_[--counts_[at[leaving[k]]]];
            sum += step_[counts_[at[entering[k]]]++];
        }
        sum_ = sum;
    }
    int size() const { return size_; }
    std::int64_t sum() const { return sum_; }

private:
    const std::int64_t *step_;
    std::array<std::int32_t, 256> counts_{};
    int size_ = 0;
    std::int64_t sum_ = 0;
};

// One row of the picture: rows top..bottom of the disk, counted from this one, lie inside.
struct DiskRows {
    const std::uint8_t *centre;
    std::ptrdiff_t width;
    int top, bottom;
    const int *half_widths;  // of row 0; rows -radius..radius

    const std::uint8_t *row(int dy) const { return centre + dy * width; }
};

void fill(SlidingHistogram &histogram, const DiskRows &disk) {
    for (int dy = disk.top; dy <= disk.bottom; ++dy) {
        const std::ptrdiff_t end = std::min<std::ptrdiff_t>(disk.half_widths[dy], disk.width - 1);
        for (std::ptrdiff_t x = 0; x <= end; ++x) histogram.add(disk.row(dy)[x]);
    }
}

// From column x to x + 1 near the left or right edge, where parts of the disk are outside.
void slide_at_edge(SlidingHistogram &histogram, const DiskRows &disk, std::ptrdiff_t x) {
    for (int dy = disk.top; dy <= disk.bottom; ++dy) {
        const std::ptrdiff_t left = x - disk.half_widths[dy], right = x + disk.half_widths[dy] + 1;
        if (left >= 0) histogram.remove(disk.row(dy)[left]);
        if (right < disk.width) histogram.add(disk.row(dy)[right]);
    }
}

} // namespace

void local_entropy(const std::uint8_t *image, int height, int width, int radius, double *entropy) {
    const std::vector<int> half_widths = disk_half_widths(radius);
    int area = 0;
    for (const int half_width : half_widths) area += 2 * half_width + 1;
    const FixedPointTable table(area);
    std::vector<std::ptrdiff_t> leaving, entering;
    for (int y = 0; y < height; ++y) {
        const DiskRows disk{image + static_cast<std::size_t>(y) * width, width,
                            std::max(-radius, -y), std::min(radius, height - 1 - y),
                            half_widths.data() + radius};
        leaving.clear();
        entering.clear();
        for (int dy = disk.top; dy <= disk.bottom; ++dy) {
            leaving.push_back(dy * disk.width - disk.half_widths[dy]);
            entering.push_back(dy * disk.width + disk.half_widths[dy] + 1);
        }
        SlidingHistogram histogram(table.step.data());
        fill(histogram, disk);
        for (int x = 0;; ++x) {
            const int n = histogram.size();
            *entropy++ = static_cast<double>(table.value[n] - histogram.sum()) * table.unit / n;
            if (x == width - 1) break;
            if (x >= radius && x + radius + 1 < width) {
                histogram.slide(disk.centre + x, leaving, entering);
            } else {
                slide_at_edge(histogram, disk, x);
            }
        }
    }
}

} // namespace retraverse
