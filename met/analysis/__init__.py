"""Questions to an experiment's models and program, apart from its runs: effects, contacts, margins, run time, and
the error of its steps."""
