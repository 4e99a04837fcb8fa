"""Questions to an experiment's models and program, apart from its runs: effects, contacts, margins, run time."""
