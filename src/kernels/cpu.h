// Which instruction sets this processor and this system let us use.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace retraverse {

// From the plainest to the newest within one family of processors. A set stands for itself and for
// all that are listed before it and belong to the same family.
enum class InstructionSet { plain, avx2, avx512, vnni, amx, neon, neondot };

const char *name_of(InstructionSet set);

// The sets that can run here, newest first; the last is always `plain`.
//
// The first call asks Linux for the AMX tile registers, which a process has to do once before
// it touches them; a refusal leaves the set out.
const std::vector<InstructionSet> &instruction_sets();

// The sets that may run when `newest` is the newest allowed, newest first. Throws
// std::invalid_argument for a name that is unknown or cannot run here.
std::vector<InstructionSet> instruction_sets_up_to(const std::string &newest);

} // namespace retraverse
