"""Refusals of operations that a model must not do while it is recorded, reported at the model's own line (E200)."""

from __future__ import annotations

import linecache
import os
import re
import sys
from itertools import islice
from types import FrameType
from typing import NoReturn

from met.diagnostic import Label, Place, Problem, error

_HERE = os.path.dirname(os.path.abspath(__file__)) + os.sep

_CHOOSE = "where(condition, a, b) computes both and keeps one"
RECORDS = "`math`, numpy and `float()` need plain numbers: met.trace has sin, sqrt, atan2 and others, which record"

_OURS = {
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "exp": "exp",
    "log": "log",
    "tanh": "tanh",
    "atan2": "atan2",
    "arctan2": "atan2",
    "asin": "asin",
    "arcsin": "asin",
    "acos": "acos",
    "arccos": "acos",
    "atan": "atan",
    "arctan": "atan",
    "sqrt": "sqrt",
    "floor": "floor",
    "rint": "rint",
    "round": "rint",
    "fabs": "absolute",
    "abs": "absolute",
    "absolute": "absolute",
    "min": "minimum",
    "max": "maximum",
    "minimum": "minimum",
    "maximum": "maximum",
    "fmin": "minimum",
    "fmax": "maximum",
    "clip": "clip",
    "sign": "sign",
    "where": "where",
    "isnan": "is_nan",
    "isfinite": "isfinite",
    "trunc": "floor",
    "fma": "fma",
    "any": "any_of",
    "all": "all_of",
    "copysign": "sign",
}


def place_of_caller() -> tuple[Place, str]:
    """The place of the first frame outside met/trace, and the piece of source that was being evaluated there."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        frame = frame.f_back
    assert frame is not None
    file, line = frame.f_code.co_filename, frame.f_lineno
    text = linecache.getline(file, line).rstrip("\n")
    positions = next(islice(frame.f_code.co_positions(), frame.f_lasti // 2, None), (None, None, None, None))
    start_line, end_line, start, end = positions
    if start_line != line or start is None or end is None:
        return Place(file, line, len(text) - len(text.lstrip()) + 1, max(len(text.strip()), 1)), text.strip()
    raw = text.encode()
    stop = end if end_line == line else len(raw)
    piece = raw[start:stop].decode(errors="replace")
    return Place(file, line, len(raw[:start].decode(errors="replace")) + 1, max(len(piece), 1)), piece


def refuse(what: str, help: str = _CHOOSE, *, truth: bool = False, function: str = "") -> NoReturn:
    """Raise E200 at the model's line: `what` was asked of a value that only a run knows.

    truth      a branch was to be decided: the word that asked (`if`, `while`, `min(`, ...) is named
    function   the foreign function that was called, whose counterpart in met.trace is then offered
    """
    place, piece = place_of_caller()
    line = linecache.getline(place.file, place.line)
    call = re.match(r"(?:[A-Za-z_]\w*\.)*([A-Za-z_]\w*)\s*\(", piece)
    name = function or (call.group(1) if call else "")
    foreign = set(re.findall(r"\b(?:math|numpy|np)\.(\w+)\s*\(", piece))
    if name not in _OURS and not truth and len(foreign) == 1:  # the piece contains more than the call
        name = foreign.pop()
    if truth and name not in _OURS:
        head = re.match(r"\s*(if|elif|while|assert)\b", line) or re.search(r"\b(if|while|and|or|not)\b", line)
        word = head.group(1) if head else ""
        what = f"{what}, for `{word}`" if word else what
        if word in ("and", "or", "not"):
            other = {"and": "both(a, b)", "or": "either(a, b)", "not": "not_(a)"}[word]
            help = f"{other} records what `{word}` would decide"
    elif name in _OURS:
        what = f"{what}, for `{piece}`"
        help = f"use met.trace.{_OURS[name]}"
    message = f"a model asks for {what}, which only a run knows"
    text = "".join(linecache.getlines(place.file))
    raise Problem(error("E200", message, Label(place, "while it is recorded"), help=help), {place.file: text})
