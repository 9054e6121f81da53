// Cell histograms for the compiler's own baseline (SSE2 on x86-64, NEON on AArch64).
#include "encoding_hog.h"

#define RETRAVERSE_HOG_NAMESPACE hog_plain
#include "encoding_hog_core.h"
