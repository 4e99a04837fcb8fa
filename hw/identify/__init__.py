"""Identification of a bed's parameters from guided moves: `met bed identify`.

moves    what it is told, within its limits
driving  the moves driven, in a process of its own; the records of it
series   records made into what was held for how long, and what was read
model    the bed for parameters that are tried, many at once
fit      the parameters under which it does what was read, and how sure they are
"""
