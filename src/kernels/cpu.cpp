#include "cpu.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>

#if defined(__x86_64__)
#include <cpuid.h>
#endif
#if defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#endif
#if defined(__aarch64__) && defined(__linux__)
#include <sys/auxv.h>
#endif

namespace retraverse {

namespace {

#if defined(__x86_64__)

// Intel's manual, volume 1, section 13: state components 17 and 18 are the tile configuration and
// the tiles; the operating system has switched them on where their bits in XCR0 are set.
bool system_saves_tiles() {
    unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
    constexpr unsigned osxsave = 1u << 27;
    if (!__get_cpuid(1, &eax, &ebx, &ecx, &edx) || !(ecx & osxsave))
        return false;
    std::uint32_t low = 0, high = 0;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    constexpr std::uint32_t tiles = 3u << 17;
    return (low & tiles) == tiles;
}

bool processor_has_amx_int8() {
    unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
    constexpr unsigned amx_tile = 1u << 24, amx_int8 = 1u << 25;
    return __get_cpuid_count(7, 0, &eax, &ebx, &ecx, &edx) && (edx & amx_tile) && (edx & amx_int8);
}

bool system_grants_tiles() {
#if defined(__linux__)
    constexpr long request_permission = 0x1023, tile_data = 18; // ARCH_REQ_XCOMP_PERM
    return syscall(SYS_arch_prctl, request_permission, tile_data) == 0;
#else
    return false;
#endif
}

std::vector<InstructionSet> detect() {
    std::vector<InstructionSet> sets{InstructionSet::plain};
    __builtin_cpu_init();
    // These builtins also ask whether the system saves the wide registers.
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
        return sets;
    sets.push_back(InstructionSet::avx2);
    if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||
        !__builtin_cpu_supports("avx512dq") || !__builtin_cpu_supports("avx512vl"))
        return sets;
    sets.push_back(InstructionSet::avx512);
    if (!__builtin_cpu_supports("avx512vnni"))
        return sets;
    sets.push_back(InstructionSet::vnni);
    if (processor_has_amx_int8() && system_saves_tiles() && system_grants_tiles())
        sets.push_back(InstructionSet::amx);
    return sets;
}

#elif defined(__aarch64__)

bool processor_has_dot_product() {
#if defined(__linux__)
    constexpr unsigned long asimddp = 1ul << 20; // HWCAP_ASIMDDP
    return getauxval(AT_HWCAP) & asimddp;
#elif defined(__APPLE__)
    return true; // every Apple processor that runs macOS on Arm
#else
    return false;
#endif
}

std::vector<InstructionSet> detect() {
    std::vector<InstructionSet> sets{InstructionSet::plain, InstructionSet::neon};
    if (processor_has_dot_product())
        sets.push_back(InstructionSet::neondot);
    return sets;
}

#else

std::vector<InstructionSet> detect() { return {InstructionSet::plain}; }

#endif

} // namespace

const char *name_of(InstructionSet set) {
    switch (set) {
    case InstructionSet::avx2: return "avx2";
    case InstructionSet::avx512: return "avx512";
    case InstructionSet::vnni: return "vnni";
    case InstructionSet::amx: return "amx";
    case InstructionSet::neon: return "neon";
    case InstructionSet::neondot: return "neondot";
    case InstructionSet::plain: break;
    }
    return "plain";
}

const std::vector<InstructionSet> &instruction_sets() {
    static const std::vector<InstructionSet> sets = [] {
        std::vector<InstructionSet> found = detect();
        std::reverse(found.begin(), found.end());
        return found;
    }();
    return sets;
}

std::vector<InstructionSet> instruction_sets_up_to(const std::string &newest) {
    const std::vector<InstructionSet> &all = instruction_sets();
    const auto first = std::find_if(all.begin(), all.end(),
                                    [&](InstructionSet set) { return newest == name_of(set); });
    if (first == all.end())
        throw std::invalid_argument("instruction set " + newest + " is not available here");
    return {first, all.end()};
}

} // namespace retraverse
