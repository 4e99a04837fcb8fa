"""Motion of a tree of rigid bodies: accelerations from torques, and torques from accelerations (docs/physics.md, 1)."""
