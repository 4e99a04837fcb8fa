"""`batch.Simulation`: a run of a deck called from Python, without files.

given       values of parameters, with units, to columns in SI
simulation  many cases a call, as a Dataset in memory
stepping    one case, step by step, by commands of one's own
"""
