"""Sweeps: what varies, in which order the cases stand, which are left out, and how many structures they are of.

axes      the block of a sweep -> its axes: lists, ranges, zips, files, samples, repeats
choices   what decides the structure: words, models, rates, macros; a run with one choice of each put in
designs   samples: lhs, sobol, random, saltelli, and the distributions they are drawn from
table     axes -> rows of the case table, parted by structure, less what `exclude when` drops
reach     which parameters a coordinate sets, and that each sets something
confidences  what a confidence asks of the cases: draws of their own, and enough of them
groups    a run, a sweep or a sum of them -> experiments
"""
