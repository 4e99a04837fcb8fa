"""Robots described elsewhere: a URDF file read, placed, and turned into the entries that a deck would hold."""
