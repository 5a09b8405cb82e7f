"""Faces of a scan: which points belong to one functional surface, and its outlines."""
