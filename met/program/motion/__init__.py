"""The base, freely moving bodies and payloads; and the view of the world that environment models get."""
