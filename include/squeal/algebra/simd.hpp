#pragma once
/// GCC compiles what follows SQUEAL_WIDE for wider registers too, and chooses when the program starts; what such a
/// function calls must be SQUEAL_INLINE to be compiled with it.
#if defined(__x86_64__) && !defined(__clang__) && __GNUC__ >= 12
#define SQUEAL_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define SQUEAL_WIDE
#endif
#define SQUEAL_INLINE inline __attribute__((always_inline))
#define SQUEAL_INLINE_LAMBDA __attribute__((always_inline))
