"""Syntax tree -> plan: resolved values in SI, with the origin of every value.

Each room imports only from those above it.

definitions   definitions by kind and name, merged with what they are like; CSV files
expressions   values, units, names, conditions on values
parameters    the parameters of one run as they are settled; models, their relations
mechanics     links, joints, payloads: inertia and frames
control       servos, commands, sensors, guides, motors on beds, rates
checks        warnings: models that do nothing, steps that are too long
runs          a run, from its block to an experiment of a plan
"""
