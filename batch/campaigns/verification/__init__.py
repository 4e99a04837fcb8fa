"""Solution verification: some of a campaign's cases again, with the dynamics at half and a quarter of the step.

The method is that of NASA-STD-7009. `verifying` decides whether to verify, chooses the cases and runs them;
`batch/archive/verified.py` stores the results, and `batch/queries/step_errors` computes errors from them.
"""
