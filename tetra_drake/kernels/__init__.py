"""Compiled numerical functions (kernels) and SIMD lanes. This package is independent of robots."""
