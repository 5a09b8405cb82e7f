"""Shapes for a face: B-spline surfaces fitted to scattered points."""
