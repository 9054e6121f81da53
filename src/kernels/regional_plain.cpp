// For any processor: vectors of four floats as the compiler knows them, so that it may use what
// every processor of its target has (SSE2 on x86-64) or none.
#include "regional_tiles.h"

namespace {

struct Float32 {
    typedef float Vector __attribute__((vector_size(16)));
    using Number = float;
    static constexpr int lanes = 4, width = 2, values_per_word = 1;
    static constexpr int rows(int width) { return width == 2 ? 4 : 8; }
    static Vector zero() { return Vector{}; }
    static Vector lowest() { return Vector{} - __builtin_inff(); }
    static Vector load(const void *words) {
        Vector values;
        __builtin_memcpy(&values, words, sizeof values);
        return values;
    }
    static Vector load_floats(const float *values) { return load(values); }
    static Vector spread(const uint32_t *word) {
        float value;
        __builtin_memcpy(&value, word, sizeof value);
        return Vector{value, value, value, value};
    }
    static Vector multiply_add(Vector sum, Vector a, Vector b) { return sum + a * b; }
    static Vector larger(Vector a, Vector b) { return a > b ? a : b; }
    static void store(float *values, Vector a) { __builtin_memcpy(values, &a, sizeof a); }
};

} // namespace

namespace retraverse {

const RegionalKernel regional_float32_plain = {
    Form::floats, Float32::lanes,          Float32::width, 8,
    0,            best_matches<Float32>, weigh<Float32>, is_finite<Float32>};

} // namespace retraverse
