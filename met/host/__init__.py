"""The computer that MET runs on: system, files, the cache of compiled objects, other Pythons, installed packages."""
