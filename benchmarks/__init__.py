"""What is measured of the project: run one as ``python -m benchmarks.NAME`` from the root of the checkout."""
