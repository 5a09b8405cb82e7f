"""Numba kernels on plain arrays, with the helper that runs them over ranges in threads."""
