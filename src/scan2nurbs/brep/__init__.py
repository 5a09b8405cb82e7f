"""Boundary representation: trimmed faces, checking, reading and writing CAD files. The only room that imports OCP."""
