"""The generator under the noise (`met.trace.philox`) as LLVM IR."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from met.trace.philox import GROWTH, LOW, MULTIPLIERS, ROUNDS

# the pattern of 2^52: a whole number below 2^52 that is added to it stands in the lowest bits of the sum's pattern
_SHIFT_BITS = 0x433 << 52


class PhiloxWriter:
    """The rounds over one set of operands, as LLVM IR over vectors of `lanes` doubles; `word` returns each of the four
    words.

    op        takes an instruction, and gives the name of what it makes
    operands  values of IR: four words of the counter, two of the key

    Integers have 64 bits, of which the low 32 count; so each product is one `vpmuludq`. They are made by a sum rather
    than a conversion, whose result is undefined out of range, and an operand is a word if it comes back unchanged.
    """

    def __init__(self, op: Callable[[str], str], operands: Sequence[str], lanes: int) -> None:
        self._op = op
        self.doubles, self.integers, self.truths = (f"<{lanes} x {kind}>" for kind in ("double", "i64", "i1"))
        words, valid = [], "splat (i1 true)"
        for x in operands:
            shifted = self._op(f"fadd {self.doubles} {x}, splat (double 0x{_SHIFT_BITS:X})")
            pattern = self._op(f"bitcast {self.doubles} {shifted} to {self.integers}")
            words.append(pattern)
            same = self._op(f"fcmp oeq {self.doubles} {x}, {self._double(pattern)}")
            valid = self._op(f"and {self.truths} {valid}, {same}")
        self.valid = valid
        self.words = self._rounds(*words)

    def word(self, n: int) -> str:
        """Word n as a double; not-a-number where an operand is not a word."""
        value = self._double(self.words[n])
        nan = "splat (double 0x7FF8000000000000)"
        return self._op(f"select {self.truths} {self.valid}, {self.doubles} {value}, {self.doubles} {nan}")

    def _low(self, x: str) -> str:
        return self._op(f"and {self.integers} {x}, splat (i64 {LOW})")

    def _double(self, x: str) -> str:
        """The number in the low 32 bits, as a double."""
        pattern = self._op(f"or {self.integers} {self._low(x)}, splat (i64 {_SHIFT_BITS})")
        shifted = self._op(f"bitcast {self.integers} {pattern} to {self.doubles}")
        return self._op(f"fsub {self.doubles} {shifted}, splat (double 0x{_SHIFT_BITS:X})")

    def _rounds(self, c0: str, c1: str, c2: str, c3: str, k0: str, k1: str) -> tuple[str, str, str, str]:
        """The rounds over vectors; the high halves of words hold anything, and are masked off before a product."""
        bits, op = self.integers, self._op
        for n in range(ROUNDS):
            if n:
                k0, k1 = (op(f"add {bits} {k}, splat (i64 {by})") for k, by in ((k0, GROWTH[0]), (k1, GROWTH[1])))
            p0, p1 = (
                op(f"mul {bits} {self._low(c)}, splat (i64 {by})")
                for c, by in ((c0, MULTIPLIERS[0]), (c2, MULTIPLIERS[1]))
            )
            h0, h1 = (op(f"lshr {bits} {p}, splat (i64 32)") for p in (p0, p1))
            c0, c2 = (op(f"xor {bits} {op(f'xor {bits} {h}, {c}')}, {k}") for h, c, k in ((h1, c1, k0), (h0, c3, k1)))
            c1, c3 = p1, p0
        return c0, c1, c2, c3
