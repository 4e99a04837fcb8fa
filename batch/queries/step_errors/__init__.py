"""The accuracy of an archive's numbers: errors due to the step, from its cases with shorter steps.

`figures` computes the errors, `words` puts them in words, `limits` compares them with the deck's limits, and `warning`
makes warnings about doubtful results.
"""
