"""Motion of a tree of rigid bodies: which accelerations from which torques, and the reverse (docs/physics.md, 1)."""
