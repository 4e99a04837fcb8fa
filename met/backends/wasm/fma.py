"""An exact fused multiply-add of two doubles a register, as LLVM IR, for machines whose WebAssembly has none.

Product and sum are computed without error (Dekker 1971, Knuth 1969), the remainder is rounded to odd, and the last sum
then rounds as the exact value would (Boldo and Melquiond, "Emulation of a FMA and correctly-rounded sums: proved
algorithms using rounding to odd", IEEE Trans. Computers 57, 2008). That holds where no part overflows or falls below
2^-1074: operands of usual sizes are used as they are, others are scaled by powers of two first, and the result is
scaled back.
"""

from __future__ import annotations

from collections.abc import Callable

from met.backends.llvm.entry import number

NAME = "met_fma"

_V, _B, _T = "<2 x double>", "<2 x i64>", "<2 x i1>"
_SIGN = -1 << 63
_EXPONENT = 0x7FF << 52
_ONE = 1023 << 52
# sizes of factors and of what is added up to which, and of factors down to which, no part leaves the range of doubles:
# a product's last bit is then at least 2^-1064
_LARGE, _SMALL, _LARGE_SUM = 2.0**480, 2.0**-480, 2.0**1000
# exponents by which a sum's parts are at most apart: the smaller then only says on which side the other one rounds
_APART = 130
# bounds of the power that is put back: beyond, every result is 0 or infinite
_LEAST, _MOST = -1400, 1200


def _double(value: float) -> str:
    return f"splat (double {number(value)})"


def _whole(value: int) -> str:
    return f"splat (i64 {value})"


class _FmaWriter:
    """Writer of instructions; each method returns the name of its result."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def op(self, text: str) -> str:
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {text}")
        return name

    def add(self, a: str, b: str) -> str:
        return self.op(f"fadd {_V} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        return self.op(f"fsub {_V} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        return self.op(f"fmul {_V} {a}, {b}")

    def whole(self, kind: str, a: str, b: str) -> str:
        return self.op(f"{kind} {_B} {a}, {b}")

    def bits(self, x: str) -> str:
        return self.op(f"bitcast {_V} {x} to {_B}")

    def of(self, x: str) -> str:
        return self.op(f"bitcast {_B} {x} to {_V}")

    def size(self, x: str) -> str:
        return self.op(f"call {_V} @llvm.fabs.v2f64({_V} {x})")

    def is_(self, kind: str, a: str, b: str) -> str:
        return self.op(f"fcmp {kind} {_V} {a}, {b}")

    def truth(self, kind: str, a: str, b: str) -> str:
        return self.op(f"{kind} {_T} {a}, {b}")

    def where(self, truth: str, a: str, b: str, kind: str = _V) -> str:
        return self.op(f"select {_T} {truth}, {kind} {a}, {kind} {b}")

    def clamped(self, x: str, least: int, most: int) -> str:
        """A whole number held between two bounds, as IR."""
        low = self.op(f"icmp slt {_B} {x}, {_whole(least)}")
        x = self.where(low, _whole(least), x, _B)
        high = self.op(f"icmp sgt {_B} {x}, {_whole(most)}")
        return self.where(high, _whole(most), x, _B)

    def power(self, k: str) -> str:
        """2^k, k whole in [-1022, 1023]."""
        return self.of(self.whole("shl", self.whole("add", k, _whole(1023)), _whole(52)))

    def signed(self, x: str, y: str) -> str:
        """x, which is not negative, with the sign of y."""
        return self.of(self.whole("or", self.bits(x), self.whole("and", self.bits(y), _whole(_SIGN))))

    def sum(self, a: str, b: str) -> tuple[str, str]:
        """The rounded sum and its error."""
        s = self.add(a, b)
        t = self.sub(s, a)
        return s, self.add(self.sub(a, self.sub(s, t)), self.sub(b, t))

    def product(self, a: str, b: str) -> tuple[str, str]:
        """The rounded product and its error."""
        (a1, a2), (b1, b2) = self.halves(a), self.halves(b)
        p = self.mul(a, b)
        rest = self.sub(p, self.mul(a1, b1))
        rest = self.sub(rest, self.mul(a2, b1))
        rest = self.sub(rest, self.mul(a1, b2))
        return p, self.sub(self.mul(a2, b2), rest)

    def halves(self, x: str) -> tuple[str, str]:
        """Two numbers of at most 26 bits whose sum is x."""
        large = self.mul(x, _double(2.0**27 + 1.0))
        high = self.sub(large, self.sub(large, x))
        return high, self.sub(x, high)

    def odd_sum(self, a: str, b: str) -> str:
        """The sum rounded to odd: where it is no double, the one of its two neighbours whose last bit is set."""
        s, error = self.sum(a, b)
        pattern = self.bits(s)
        inexact = self.op(f"sext {_T} {self.is_('une', error, 'zeroinitializer')} to {_B}")
        # -1 where s is even, else 0; 1 where the sum is beyond s, -1 where it is before it
        even = self.whole("sub", self.whole("and", pattern, _whole(1)), _whole(1))
        apart = self.whole("ashr", self.whole("xor", pattern, self.bits(error)), _whole(63))
        step = self.whole("or", apart, _whole(1))
        step = self.whole("and", step, self.whole("and", inexact, even))
        return self.of(self.whole("add", pattern, step))

    def parts(self, p: tuple[str, str], c: str) -> tuple[str, str]:
        """Two doubles whose rounded sum is that of p's and c."""
        high, low = self.sum(c, p[1])
        upper, rest = self.sum(p[0], high)
        return upper, self.odd_sum(low, rest)

    def significand(self, x: str) -> tuple[str, str]:
        """x = m 2^k, m in [1, 2) but for its sign; x is finite and not 0."""
        small = self.is_("olt", self.size(x), _double(2.0**-1022))
        pattern = self.bits(self.where(small, self.mul(x, _double(2.0**54)), x))
        k = self.whole("and", self.whole("lshr", pattern, _whole(52)), _whole(0x7FF))
        k = self.whole("sub", k, self.where(small, _whole(1023 + 54), _whole(1023), _B))
        m = self.whole("or", self.whole("and", pattern, _whole(~_EXPONENT)), _whole(_ONE))
        return self.of(m), k


def _usual(w: _FmaWriter) -> None:
    """The function's first part: the result where both lanes have usual sizes, or a factor 0."""
    a, b, c = w.size("%a"), w.size("%b"), w.size("%c")
    order = w.is_("olt", a, b)
    less, more = w.where(order, a, b), w.where(order, b, a)
    inside = w.truth("and", w.is_("oge", less, _double(_SMALL)), w.is_("ole", more, _double(_LARGE)))
    plain = w.truth("or", w.is_("oeq", a, "zeroinitializer"), w.is_("oeq", b, "zeroinitializer"))
    added = w.is_("ole", c, _double(_LARGE_SUM))
    easy = w.truth("or", plain, w.truth("and", inside, added))
    upper, rest = w.parts(w.product("%a", "%b"), "%c")
    simple = w.add(w.mul("%a", "%b"), "%c")
    result = w.where(plain, simple, w.add(upper, rest))
    both = w.op(f"bitcast {_T} {easy} to i2")
    every = w.op(f"icmp eq i2 {both}, -1")
    w.lines += [f"  br i1 {every}, label %easy, label %any", "easy:", f"  ret {_V} {result}", "any:"]


def _any(w: _FmaWriter) -> None:
    """The function's last part: operands of any size."""
    a, ka = w.significand("%a")
    b, kb = w.significand("%b")
    c, kc = w.significand("%c")
    none = w.is_("oeq", "%c", "zeroinitializer")
    c = w.where(none, "zeroinitializer", c)
    k = w.whole("add", ka, kb)
    apart = w.where(none, "zeroinitializer", w.whole("sub", kc, k), _B)
    near = w.clamped(apart, -_APART, _APART)
    # where the addend is out of range, everything is scaled down
    beyond = w.whole("sub", apart, near)
    above = w.op(f"icmp sgt {_B} {beyond}, zeroinitializer")
    k = w.whole("add", k, w.where(above, beyond, "zeroinitializer", _B))
    k = w.clamped(k, _LEAST, _MOST)
    upper, rest = w.parts(w.product(a, b), w.mul(c, w.power(near)))
    rounded = w.add(upper, rest)

    # a result below 2^-1022 has fewer bits: it is rounded by a sum whose last bit is the one that 2^-1074 will be
    least = w.whole("sub", _whole(-1022), w.clamped(k, _LEAST, 0))
    floor = w.power(least)
    small = w.is_("olt", w.size(rounded), floor)
    shift = w.signed(floor, upper)
    high, low = w.sum(shift, upper)
    coarse = w.sub(w.add(high, w.odd_sum(low, rest)), shift)
    small = w.truth("and", small, w.op(f"icmp slt {_B} {k}, zeroinitializer"))
    value = w.where(small, w.signed(w.size(coarse), rounded), rounded)
    half = w.whole("ashr", k, _whole(1))
    value = w.mul(w.mul(value, w.power(half)), w.power(w.whole("sub", k, half)))

    # results that are not finite, or have a factor 0, need no scaling
    finite = [w.is_("olt", w.size(x), _double(float("inf"))) for x in ("%a", "%b", "%c")]
    factors = w.truth("and", finite[0], finite[1])
    some = w.truth("and", w.is_("une", "%a", "zeroinitializer"), w.is_("une", "%b", "zeroinitializer"))
    usual = w.truth("and", factors, some)
    simple = w.add(w.mul("%a", "%b"), "%c")
    value = w.where(finite[2], value, w.add("%c", "zeroinitializer"))
    w.lines.append(f"  ret {_V} {w.where(usual, value, simple)}")


def function(attributes: str) -> str:
    """The function `met_fma`: a b + c, rounded once, in both lanes. attributes: of the function, as IR."""
    w = _FmaWriter()
    steps: tuple[Callable[[_FmaWriter], None], ...] = (_usual, _any)
    for step in steps:
        step(w)
    head = f"define internal {_V} @{NAME}({_V} %a, {_V} %b, {_V} %c) {attributes} {{"
    return "\n".join([head, *w.lines, "}"])
