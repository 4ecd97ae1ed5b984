"""SIMD lanes and the compilation of kernels. This package is independent of robots."""
