"""`met fmt`: uniform layout of a deck's text, with unchanged tokens and comments.

    text  --rows-->  rows of pieces, brackets matched  --layout-->  text  --proof-->  the same tokens as before

The author decides where lines break, what stands on one line, and what is aligned with its neighbours. The formatter
decides indentation, the blanks between tokens, how wide an alignment is, and how many lines may be blank.
"""
