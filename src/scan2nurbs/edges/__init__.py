"""Edges of a scan: operators that find points on them, filters, thinning, curves."""
