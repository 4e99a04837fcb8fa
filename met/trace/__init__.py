"""Scalars that record the computations done with them.

`graph` holds the record, `functions` the functions that models call; both are exported here. `noise` draws random
numbers. `program` has phases under a little control flow over a case's memory; `reference` runs a program over plain
floats, `llvm` makes machine code of it, `c` writes it as C: those are imported from their own modules, so that checking
a deck does not load them.
"""

from met.trace.functions import (
    absolute,
    acos,
    all_of,
    any_of,
    asin,
    atan,
    atan2,
    both,
    clip,
    cos,
    either,
    exp,
    floor,
    fma,
    gather,
    is_nan,
    isfinite,
    log,
    maximum,
    minimum,
    not_,
    rint,
    sign,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from met.trace.graph import Formulas, Graph, Real, Truth
from met.trace.scalar import Mask, Scalar

__all__ = [
    "Formulas",
    "Graph",
    "Mask",
    "Real",
    "Scalar",
    "Truth",
    "absolute",
    "acos",
    "all_of",
    "any_of",
    "asin",
    "atan",
    "atan2",
    "both",
    "clip",
    "cos",
    "either",
    "exp",
    "floor",
    "fma",
    "gather",
    "is_nan",
    "isfinite",
    "log",
    "maximum",
    "minimum",
    "not_",
    "rint",
    "sign",
    "sin",
    "sqrt",
    "tan",
    "tanh",
    "where",
]
