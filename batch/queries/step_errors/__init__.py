"""The accuracy of an archive's numbers: errors due to the step, from its cases with shorter steps.

`figures` computes the errors, compares them with the deck's limits and puts them in words; `warning` makes warnings
about doubtful results.
"""
