"""Robots described elsewhere: reading a URDF file, with places, and its conversion to a deck's entries."""
