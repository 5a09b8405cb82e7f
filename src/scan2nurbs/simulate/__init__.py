"""A scanner in software: noisy, incomplete point clouds of CAD parts, with the truth beside them."""

from scan2nurbs.simulate.params import SimulateParams
from scan2nurbs.simulate.scan import SimulatedScan, simulate_scan
from scan2nurbs.simulate.write import write_scan

__all__ = ["SimulateParams", "SimulatedScan", "simulate_scan", "write_scan"]
