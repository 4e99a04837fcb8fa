"""Benchmarks of MET, a file a subject. To add one: write it, and name it in the tuple of __main__.py."""
