// Cell histograms for AVX2 and FMA.
#include "encoding_hog.h"

#define RETRAVERSE_HOG_NAMESPACE hog_avx2
#include "encoding_hog_core.h"
