#pragma once

#include <malloc.h>

namespace fxdyn {

/// Freed memory stays with the program, up to 128 MB: the next matrix of the same size takes it again. Otherwise glibc
/// gives blocks of a megabyte back to the system, and each new matrix costs a page fault for every 4 KB. On a virtual
/// machine that was three quarters of the time of a held-out sweep (docs/findings/2026-11-22-bls-options.md).
/// For the first line of main().
inline void keep_freed_memory() {
  constexpr int mmap_bytes = 32 << 20;  // the most that glibc takes
  constexpr int trim_bytes = 128 << 20;
  mallopt(M_MMAP_THRESHOLD, mmap_bytes);
  mallopt(M_TRIM_THRESHOLD, trim_bytes);
}

/// What keep_freed_memory() kept goes back to the system: between stages, where the next one needs other matrices than
/// the last. Otherwise holes that no longer fit add up with long logs.
inline void give_back_memory() { malloc_trim(0); }

}  // namespace fxdyn
