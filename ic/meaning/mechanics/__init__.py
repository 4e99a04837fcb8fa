"""Arms: links, joints, payloads, their inertia and frames."""
