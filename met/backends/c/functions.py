"""The C functions that `met.backends.c.emit` calls: operations that C lacks, or leaves to a library, exact to the last
bit.

They need no library and no header but stdint.h and float.h, so they hold on a bare controller too. Doubles are IEEE's,
rounded to nearest; `met_fma` and `met_sqrt` are rounded correctly, with whole numbers alone.
"""

from __future__ import annotations

from collections.abc import Iterable

from met.frozen import frozen
from met.trace.philox import GROWTH, MULTIPLIERS, ROUNDS


@frozen
class Function:
    """The text of one function, and the names of those that it calls."""

    text: str
    calls: tuple[str, ...] = ()


HEAD = """\
#include <float.h>
#include <stdint.h>

/* Every operation is rounded by itself, and only what is written as met_fma is fused. */
#if defined(__FAST_MATH__) || FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 2
#error "build without -ffast-math, for a processor that computes doubles as doubles"
#endif
#if defined(__FP_FAST_FMA) || defined(__FMA__) || defined(__aarch64__)
#define MET_HAS_FMA 1
#if defined(__GNUC__) && !defined(__clang__) && !defined(__STRICT_ANSI__)
#error "build with -std=c11 and -ffp-contract=off"
#endif
#else
#define MET_HAS_FMA 0
#endif
/* libgcc's sum for ARM is wrong at times where exponents are 33 apart: where sums are its, they are made here. */
#if defined(__arm__) && !(defined(__ARM_FP) && (__ARM_FP & 8))
#define MET_OWN_SUM 1
#else
#define MET_OWN_SUM 0
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
/* Which of the functions below are called depends on the processor. */
#ifdef __GNUC__
#define MET_LOCAL static __attribute__((__unused__))
#else
#define MET_LOCAL static
#endif
"""
"""Text before the functions of a program in C."""

FUNCTIONS: dict[str, Function] = {
    "bits": Function("""\
MET_LOCAL uint64_t met_bits(double x)
{
    union { double number; uint64_t bits; } both;
    both.number = x;
    return both.bits;
}
"""),
    "of": Function("""\
MET_LOCAL double met_of(uint64_t bits)
{
    union { double number; uint64_t bits; } both;
    both.bits = bits;
    return both.number;
}
"""),
    "abs": Function(
        """\
MET_LOCAL double met_abs(double x)
{
    return met_of(met_bits(x) & UINT64_C(0x7FFFFFFFFFFFFFFF));
}
""",
        ("bits", "of"),
    ),
    "signed": Function(
        """\
/* x with the sign of y. */
MET_LOCAL double met_signed(double x, double y)
{
    return met_of((met_bits(x) & UINT64_C(0x7FFFFFFFFFFFFFFF)) | (met_bits(y) & UINT64_C(0x8000000000000000)));
}
""",
        ("bits", "of"),
    ),
    "floor": Function(
        """\
MET_LOCAL double met_floor(double x)
{
    double whole;
    if (!(met_abs(x) < 4503599627370496.0)) return x;
    whole = (double)(int64_t)x;
    return met_signed(whole > x ? whole - 1.0 : whole, x);
}
""",
        ("abs", "signed"),
    ),
    "rint": Function(
        """\
MET_LOCAL double met_rint(double x)
{
    const double size = met_abs(x);
    if (!(size < 4503599627370496.0)) return x;
    return met_signed((size + 4503599627370496.0) - 4503599627370496.0, x);
}
""",
        ("abs", "signed"),
    ),
    "flip": Function(
        """\
/* x, or -x where bit n of t is set. */
MET_LOCAL double met_flip(double x, double t, int n)
{
    return met_of(met_bits(x) ^ ((met_bits(t) << (63 - n)) & UINT64_C(0x8000000000000000)));
}
""",
        ("bits", "of"),
    ),
    "bit": Function(
        """\
MET_LOCAL int met_bit(double x, int n)
{
    return (int)((met_bits(x) >> n) & 1U);
}
""",
        ("bits",),
    ),
    "exponent": Function(
        """\
MET_LOCAL double met_exponent(double x)
{
    return (double)((int)((met_bits(x) >> 52) & 0x7FFU) - 1023);
}
""",
        ("bits",),
    ),
    "significand": Function(
        """\
MET_LOCAL double met_significand(double x)
{
    return met_of((met_bits(x) & UINT64_C(0x000FFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000));
}
""",
        ("bits", "of"),
    ),
    "gather": Function(
        """\
/* Entry number `index` (its whole part) of a table that ends at `last`. */
MET_LOCAL double met_gather(const uint64_t *table, double last, double index)
{
    double held = index > 0.0 ? index : 0.0;
    if (index != index) return index;
    held = held < last ? held : last;
    return met_of(table[(int32_t)held]);
}
""",
        ("of",),
    ),
    "usual": Function(
        """\
/* Whether x is finite and not 0. Comparisons of doubles are dear where they are made of whole numbers. */
MET_LOCAL int met_usual(double x)
{
    const uint64_t size = met_bits(x) << 1;
    return size != 0 && size < UINT64_C(0xFFE0000000000000);
}
""",
        ("bits",),
    ),
    "top": Function("""\
/* Number of the highest bit that is set; x is not 0. */
MET_LOCAL int met_top(uint64_t x)
{
#ifdef __GNUC__
    return 63 - __builtin_clzll(x);
#else
    int n = 0, step;
    for (step = 32; step > 0; step /= 2) {
        if (x >> step) {
            x >>= step;
            n += step;
        }
    }
    return n;
#endif
}
"""),
    "split": Function(
        """\
/* |x| = m 2^e, m in [2^52, 2^53): gives e. x is finite and not 0. */
MET_LOCAL int met_split(double x, uint64_t *m)
{
    const uint64_t bits = met_bits(x) & UINT64_C(0x7FFFFFFFFFFFFFFF);
    const uint64_t fraction = bits & UINT64_C(0x000FFFFFFFFFFFFF);
    int shift;
    if (bits >> 52) {
        *m = fraction | UINT64_C(0x0010000000000000);
        return (int)(bits >> 52) - 1075;
    }
    shift = 52 - met_top(fraction);
    *m = fraction << shift;
    return -1074 - shift;
}
""",
        ("bits", "top"),
    ),
    "sqrt": Function(
        """\
/* The square root: 54 bits of it, one by one; the last one rounds, for no root lies half way. */
MET_LOCAL double met_sqrt(double x)
{
    uint64_t m, root = 0, rest = 0;
    int e, i;
    if (x == 0.0 || x != x) return x;
    if (x < 0.0) return met_of(UINT64_C(0x7FF8000000000000));
    if (x > DBL_MAX) return x;
    e = met_split(x, &m);
    if (e % 2 != 0) {
        m <<= 1;
        e -= 1;
    }
    for (i = 0; i < 54; i++) {
        rest = (rest << 2) | ((m >> 52) & 3U);
        m = (m << 2) & UINT64_C(0x003FFFFFFFFFFFFF);
        root <<= 1;
        if (rest > 2 * root) {
            rest -= 2 * root + 1;
            root += 1;
        }
    }
    return met_of(((uint64_t)(e / 2 + 1048) << 52) + ((root + 1) >> 1));
}
""",
        ("of", "split"),
    ),
    "jam": Function("""\
typedef struct { uint64_t high, low; } met_wide;

/* x / 2^n, n >= 0; the lowest bit is set where a bit was lost. */
MET_LOCAL void met_jam(met_wide *x, int n)
{
    uint64_t lost = 0;
    if (n >= 128) {
        lost = x->high | x->low;
        x->high = 0;
        x->low = 0;
    } else if (n >= 64) {
        lost = x->low | (n > 64 ? x->high << (128 - n) : 0);
        x->low = x->high >> (n - 64);
        x->high = 0;
    } else if (n > 0) {
        lost = x->low << (64 - n);
        x->low = (x->low >> n) | (x->high << (64 - n));
        x->high >>= n;
    }
    x->low |= lost != 0;
}
"""),
    "sum": Function(
        """\
/* x 2^e + y 2^f, rounded to nearest; neither is 0, the highest bit of each is its bit 124 or 125; signs by bit 63. */
MET_LOCAL double met_sum(uint64_t x_sign, met_wide *x, int e, uint64_t y_sign, met_wide *y, int f)
{
    met_wide sum;
    uint64_t m, rest;
    int shift;
    if (e > f) {
        met_jam(y, e - f);
    } else {
        met_jam(x, f - e);
        e = f;
    }
    if (x_sign == y_sign) {
        sum.low = x->low + y->low;
        sum.high = x->high + y->high + (sum.low < x->low);
    } else {
        if (x->high < y->high || (x->high == y->high && x->low < y->low)) {
            met_wide *const less = x;
            x = y;
            y = less;
            x_sign = y_sign;
        }
        sum.low = x->low - y->low;
        sum.high = x->high - y->high - (x->low < y->low);
        if ((sum.high | sum.low) == 0) return 0.0;
    }
    shift = (sum.high ? 64 + met_top(sum.high) : met_top(sum.low)) - 52;
    if (shift < -1074 - e) shift = -1074 - e;
    /* in units of the result's last place, with two more bits: a half, and whether there is more */
    if (shift < 2) {
        m = sum.low << (2 - shift);
    } else {
        met_jam(&sum, shift - 2);
        m = sum.low;
    }
    rest = m & 3U;
    m >>= 2;
    if (rest == 3 || (rest == 2 && (m & 1U))) m += 1;
    e += shift + 1074;
    if (e >= 2046) return met_of(x_sign | UINT64_C(0x7FF0000000000000));
    return met_of(x_sign | (((uint64_t)e << 52) + m));
}
""",
        ("of", "top", "jam"),
    ),
    "add": Function(
        """\
#if MET_OWN_SUM
MET_LOCAL double met_add(double a, double b)
{
    const uint64_t sign = UINT64_C(0x8000000000000000);
    met_wide x, y;
    int e, f;
    if (!met_usual(a) || !met_usual(b)) return a + b;
    e = met_split(a, &x.high) - 73;
    f = met_split(b, &y.high) - 73;
    x.high <<= 9;
    x.low = 0;
    y.high <<= 9;
    y.low = 0;
    return met_sum(met_bits(a) & sign, &x, e, met_bits(b) & sign, &y, f);
}
#else
MET_LOCAL double met_add(double a, double b)
{
    return a + b;
}
#endif
""",
        ("usual", "bits", "split", "sum"),
    ),
    "fma": Function(
        """\
#if MET_HAS_FMA
/* Never put in its caller's place: gcc makes -a*b - c of -(a*b + c), whose zero has the other sign. */
__attribute__((__noinline__)) MET_LOCAL double met_fma(double a, double b, double c)
{
    return __builtin_fma(a, b, c);
}
#else
/* a*b + c, rounded once. */
MET_LOCAL double met_fma(double a, double b, double c)
{
    const uint64_t sign = UINT64_C(0x8000000000000000), half = UINT64_C(0xFFFFFFFF);
    uint64_t m, n, low, middle;
    met_wide x, y;
    int e, f;
    if (!met_usual(a) || !met_usual(b)) return a * b + c;
    if (!met_usual(c)) return c == 0.0 ? a * b : c;
    e = met_split(a, &m) + met_split(b, &n) - 20;
    f = met_split(c, &y.high) - 73;
    y.high <<= 9;
    y.low = 0;
    low = (m & half) * (n & half);
    middle = (m & half) * (n >> 32) + (m >> 32) * (n & half) + (low >> 32);
    low = (middle << 32) | (low & half);
    x.high = (((m >> 32) * (n >> 32) + (middle >> 32)) << 20) | (low >> 44);
    x.low = low << 20;
    return met_sum((met_bits(a) ^ met_bits(b)) & sign, &x, e, met_bits(c) & sign, &y, f);
}
#endif
""",
        ("usual", "bits", "split", "sum"),
    ),
    "pow2": Function(
        """\
MET_LOCAL double met_pow2(double k)
{
    return met_of(met_bits(met_add(k, 4503599627371519.0)) << 52);
}
""",
        ("bits", "of", "add"),
    ),
    "philox": Function(
        f"""\
/* Philox4x32-10 of four words of a counter and two of a key; not numbers where one is no word. */
MET_LOCAL void met_philox(double c0, double c1, double c2, double c3, double k0, double k1, double *result)
{{
    double given[6];
    uint32_t w[6];
    int i;
    given[0] = c0;
    given[1] = c1;
    given[2] = c2;
    given[3] = c3;
    given[4] = k0;
    given[5] = k1;
    for (i = 0; i < 6; i++) {{
        w[i] = given[i] >= 0.0 && given[i] <= 4294967295.0 ? (uint32_t)given[i] : 0;
        if (given[i] != (double)w[i]) {{
            for (i = 0; i < 4; i++) result[i] = met_of(UINT64_C(0x7FF8000000000000));
            return;
        }}
    }}
    for (i = 0; i < {ROUNDS}; i++) {{
        const uint64_t p = UINT64_C(0x{MULTIPLIERS[0]:X}) * w[0], q = UINT64_C(0x{MULTIPLIERS[1]:X}) * w[2];
        w[0] = (uint32_t)(q >> 32) ^ w[1] ^ w[4];
        w[1] = (uint32_t)q;
        w[2] = (uint32_t)(p >> 32) ^ w[3] ^ w[5];
        w[3] = (uint32_t)p;
        w[4] += UINT32_C(0x{GROWTH[0]:X});
        w[5] += UINT32_C(0x{GROWTH[1]:X});
    }}
    for (i = 0; i < 4; i++) result[i] = (double)w[i];
}}
""",
        ("of",),
    ),
}
"""By name, each after those that it calls; in C the names begin with `met_`."""


def functions(wanted: Iterable[str]) -> str:
    """The text of the functions of these names, and of all that they call."""
    needed: set[str] = set()
    waiting = list(wanted)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting += FUNCTIONS[name].calls
    return "\n".join(function.text for name, function in FUNCTIONS.items() if name in needed)
