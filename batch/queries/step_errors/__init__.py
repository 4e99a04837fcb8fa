"""How true an archive's numbers are: errors by the step, from what it keeps of cases with shorter steps.

`figures` makes errors of them, `words` says them, `limits` holds them against what the deck requires, and `warning`
says what they call in question.
"""
