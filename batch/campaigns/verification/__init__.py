"""Some of a campaign's cases again, with the dynamics at half and a quarter of the step.

Solution verification, as NASA-STD-7009 has it. `when` says whether, `choosing` which cases, and `verifying` runs them;
`batch/archive/verified.py` keeps what was computed, and `batch/queries/step_errors` makes errors of it.
"""
