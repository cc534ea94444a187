#pragma once
/// Attributes for functions with vector registers of several widths. GCC compiles a function marked SQUEAL_SIMD for
/// AVX-512, for AVX2 and for the default target, and the program chooses at its start. What such a function calls must
/// be marked SQUEAL_INLINE (a lambda: SQUEAL_INLINE_LAMBDA), so that it is compiled with it.
#if defined(__x86_64__) && !defined(__clang__) && __GNUC__ >= 12
#define SQUEAL_SIMD __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#define SQUEAL_HAS_AVX512 __builtin_cpu_supports("x86-64-v4") // whether the first of these is what runs
#else
#define SQUEAL_SIMD
#define SQUEAL_HAS_AVX512 false
#endif
#define SQUEAL_INLINE inline __attribute__((always_inline))
#define SQUEAL_INLINE_LAMBDA __attribute__((always_inline))
