"""Analyses of an experiment's models and program without its runs: effects, contacts, margins, run time, step error."""
