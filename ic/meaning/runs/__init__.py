"""Resolution of runs, each to an experiment of a plan."""
