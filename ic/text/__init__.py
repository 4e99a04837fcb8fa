"""Deck text -> tokens: the preprocessor over a lexer of our own, with the origin of every token."""
