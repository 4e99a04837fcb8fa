"""Noise: numbers that look random and depend only on their stream and tick, recorded or plain.

A stream is (seed, repeat, channel), a value (stream, tick). Nothing is held between draws, so a value depends neither
on the order of draws nor on other draws, and cases that differ only in a gain feel the same noise.

The generator is Philox4x32-10 (met/trace/philox.py). Its counter holds the low 32 bits of the tick and the rest, then
the repeat and the channel's number; its key holds the low 32 bits of the seed and the rest. One counter gives four
words: two uniform deviates, or two normal ones.

A channel is for one kind of draw: `uniform` and `normal` of the same stream and tick are made of the same words.
"""

from __future__ import annotations

import math
import zlib

from met.frozen import frozen
from met.trace import functions
from met.trace.functions import cos, floor, fma, log, sin, sqrt, where
from met.trace.graph import Real


@frozen
class Stream:
    """One source of noise in one case.

    seed      of the run: a whole number in [0, 2^53]
    repeat    of the case: a whole number in [0, 2^32)
    channel   the name of what is noisy, such as `elbow.servo.tachometer`; an independent stream for each name

    Where one of them is negative, not whole or no number, the draws are not numbers.
    """

    seed: Real
    repeat: Real
    channel: str


def channel_number(name: str) -> int:
    """The number of a channel, in [0, 2^32): the CRC-32 (that of zip files) of its name in UTF-8.

    Two names of one length that differ in no more than four neighbouring bytes never share a number. Any other two do
    so once in 2^32, and then have the same noise.
    """
    return zlib.crc32(name.encode())


def uniform(stream: Stream, tick: Real) -> Real:
    """A number in the open interval (0, 1), in steps of 2^-53. tick: a whole number in [0, 2^53]."""
    return uniform_pair(stream, tick)[0]


def uniform_pair(stream: Stream, tick: Real) -> tuple[Real, Real]:
    """Two independent uniform deviates; the first is `uniform`'s."""
    words = _words(stream, tick)
    return _fraction(words[0], words[1]), _fraction(words[2], words[3])


def normal(stream: Stream, tick: Real) -> Real:
    """A normal deviate of mean 0 and variance 1, at most 8.7 in size. tick: a whole number in [0, 2^53].

    It is the first of `normal_pair`. The second is not computed unless it is asked for.
    """
    return normal_pair(stream, tick)[0]


def normal_pair(stream: Stream, tick: Real) -> tuple[Real, Real]:
    """Two independent normal deviates from the two uniform ones of that tick (Box and Muller 1958).

    Together they cost little more than one: for a channel of two axes, or of a value and its rate.
    """
    first, second = uniform_pair(stream, tick)
    radius = sqrt(-2.0 * log(first))
    angle = 2.0 * math.pi * second
    return radius * cos(angle), radius * sin(angle)


def _words(stream: Stream, tick: Real) -> tuple[Real, ...]:
    """The four words of a tick, each a whole number in [0, 2^32)."""
    counter = (*_halves(tick), stream.repeat, float(channel_number(stream.channel)))
    key = _halves(stream.seed)
    return tuple(functions.philox(*counter, *key, word) for word in range(4))


def _halves(x: Real) -> tuple[Real, Real]:
    """The low and the high 32 bits of a whole number."""
    high = floor(x * 2.0**-32)
    return fma(-high, 2.0**32, x), high


def _fraction(high: Real, low: Real) -> Real:
    """The number in (0, 1) from 53 bits: all of `high` and the upper 21 of `low`; half a step where all are zero."""
    whole = fma(high, 2.0**21, floor(low * 2.0**-11))
    return where(whole < 0.5, 0.5, whole) * 2.0**-53
