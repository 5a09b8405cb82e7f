"""scan2nurbs: from a raw 3D scan to an editable CAD model."""
