"""How true a campaign's numbers are: some of its cases again, with the dynamics at half and a quarter of the step.

Solution verification, as NASA-STD-7009 has it. `choosing` says which cases, `verifying` runs them, `figures` makes
errors of them; `batch/archive/verified.py` keeps what was computed.
"""
