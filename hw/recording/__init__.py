"""Records of a bed, one for each exchange, and the process that writes them to the disk."""
