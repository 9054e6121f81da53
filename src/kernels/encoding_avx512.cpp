// Cell histograms for AVX-512.
#include "encoding_hog.h"

#define RETRAVERSE_HOG_NAMESPACE hog_avx512
#include "encoding_hog_core.h"
