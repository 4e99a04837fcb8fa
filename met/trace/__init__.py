"""Scalars that record what is computed with them, and the back ends that run the record.

`graph` holds the record, `functions` what models call, `program` phases under a little control flow over a case's
memory; `reference` runs a program over plain floats, `llvm` makes machine code of it.
"""

from met.trace.functions import (
    absolute,
    all_of,
    any_of,
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
from met.trace.program import Control, Every, Phase, Program, Record, Run, Tape, Unless0, WhileAny
from met.trace.reference import execute
from met.trace.scalar import Mask, Scalar

__all__ = [
    "Control", "Every", "Formulas", "Graph", "Mask", "Phase", "Program", "Real", "Record", "Run", "Scalar", "Tape",
    "Truth", "Unless0", "WhileAny", "absolute", "all_of", "any_of", "atan2", "both", "clip", "cos", "either", "execute",
    "exp", "floor", "fma", "gather", "is_nan", "isfinite", "log", "maximum", "minimum", "not_", "rint", "sign", "sin",
    "sqrt", "tan", "tanh", "where",
]
