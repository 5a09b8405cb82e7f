"""A scanner in software: noisy, incomplete point clouds of CAD parts, with the truth beside them."""
