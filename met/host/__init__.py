"""The computer that MET runs on: files, the cache of compiled objects, other Pythons, installed packages."""
