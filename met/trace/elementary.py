"""sin, cos, exp, log, atan2 and the like as recorded primitives, by which all back ends agree to the bit.

Arguments are reduced with fused multiply-adds, then polynomials. sin and cos of one argument share everything but a
choice. Errors over the whole range, in units in the last place, are tested against 60 digits and more
(tests/met/trace/test_accuracy.py): exp and log 1; sin and cos 1.6, tan 2.4, up to 2^48 rad (then see there);
atan2 and atan 2; asin and acos 2.6; tanh 2.7. atan2, atan and asin keep the sign of a zero, the others may not.

Coefficients of sin, cos, log and atan are fdlibm's (Sun Microsystems 1993, k_sin.c, k_cos.c, e_log.c, s_atan.c); exp's
are a minimax fit of (e^r - 1 - r)/r^2 on |r| <= ln(2)/2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from met.trace.primitives import exact_sum
from met.trace.scalar import Mask, Scalar

# pi/2 in three parts, each the double nearest to the remainder; the first product with a whole number is then exact
_QUARTER = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
# 1.5 * 2^52: added, a number is rounded to a whole one, whose lowest bits are the sum's
_ROUND = 6755399441055744.0

# up to here sin, cos and tan have the stated accuracy; a turn is then less than 200 steps of the angle itself
FARTHEST = 2.0**48

_SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
_ATAN = (
    -3.33333333333329318027e-01,
    1.99999999998764832476e-01,
    -1.42857142725034663711e-01,
    1.11111104054623557880e-01,
    -9.09088713343650656196e-02,
    7.69187620504482999495e-02,
    -6.66107313738753120669e-02,
    5.83357013379057348645e-02,
    -4.97687799461593236017e-02,
    3.65315727442169155270e-02,
    -1.62858201153657823623e-02,
)
_EXP = (
    0.5,
    0.1666666666666667,
    0.041666666666666685,
    0.008333333333326134,
    0.001388888888887438,
    0.00019841269874821518,
    2.4801587347385123e-05,
    2.7557255399268295e-06,
    2.755725286526061e-07,
    2.5105217339707257e-08,
    2.0921605996123163e-09,
)
_LN2 = (0.6931471805599453, 2.3190468138462996e-17)
# ln(2) with 20 trailing zero bits, so that its product with an exponent is exact, and the rest
_LN2_SPLIT = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
_ATAN_HALF = (0.4636476090008061, 2.2698777452961687e-17)
_PI = (3.141592653589793, 1.2246467991473532e-16)


def _fma(a: Scalar | float, b: Scalar | float, c: Scalar | float) -> Scalar:
    graph = next(x for x in (a, b, c) if isinstance(x, Scalar)).graph
    a, b, c = (x.ref if isinstance(x, Scalar) else graph.constant(x) for x in (a, b, c))
    return Scalar(graph, graph.fma(a, b, c))


def _where(mask: Mask, a: Scalar | float, b: Scalar | float) -> Scalar:
    graph = mask.graph
    a, b = (x.ref if isinstance(x, Scalar) else graph.constant(x) for x in (a, b))
    return Scalar(graph, graph.where(mask.ref, a, b))


def _unary(op: str, x: Scalar) -> Scalar:
    return Scalar(x.graph, x.graph.unary(op, x.ref))


def _bit(x: Scalar, n: int) -> Mask:
    return Mask(x.graph, x.graph.bit(x.ref, n))


def _flip(x: Scalar, t: Scalar, n: int) -> Scalar:
    return Scalar(x.graph, x.graph.flip(x.ref, t.ref, n))


def _polynomial(coefficients: Sequence[float], z: Scalar) -> Scalar:
    """Horner's scheme, constant term first."""
    result: Scalar | float = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = _fma(result, z, coefficient)
    assert isinstance(result, Scalar)
    return result


def _quadrant(x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """The quarter turns of x in the lowest bits of t, and sine and cosine of the remainder: (t, s, c).

    The remainder is right to a unit in its last place up to |x| = FARTHEST. Beyond 2^51 it is meaningless: a check
    would cost three operations for every joint that turns, and no angle of an arm gets near.
    """
    t = _fma(x, 2.0 / math.pi, _ROUND)
    k = t - _ROUND
    r = x
    for part in _QUARTER:
        r = _fma(-k, part, r)
    z = r * r
    s = _fma(r * z, _polynomial(_SIN, z), r)
    c = _fma(z * z, _polynomial(_COS, z), _fma(-0.5, z, 1.0))
    return t, s, c


def sin(x: Scalar) -> Scalar:
    """The sine of x rad, |x| <= 2^48: accuracy falls beyond, and is lost from 2^51 on; not-a-number for infinity."""
    t, s, c = _quadrant(x)
    return _flip(_where(_bit(t, 0), c, s), t, 1)


def cos(x: Scalar) -> Scalar:
    """The cosine of x rad, |x| <= 2^48; beyond, as for the sine."""
    t, s, c = _quadrant(x)
    return _flip(_where(_bit(t, 0), s, c), t + 1.0, 1)


def tan(x: Scalar) -> Scalar:
    """The tangent of x rad; not a number where |x| > 2^48.

    A quotient shows the errors of both its parts, so the remainder of x is carried as a sum here, r + rest.
    """
    t = _fma(x, 2.0 / math.pi, _ROUND)
    k = t - _ROUND
    first = _fma(-k, _QUARTER[0], x)
    product = k * _QUARTER[1]
    error = _fma(k, _QUARTER[1], -product)
    r, lost = exact_sum(first, -product)
    r, rest = exact_sum(r, _fma(-k, _QUARTER[2], lost - error))
    r = _where(abs(x) <= FARTHEST, r, math.nan)
    z = r * r
    s = r + _fma(r * z, _polynomial(_SIN, z), rest)
    high = _fma(-0.5, z, 1.0)
    low = _fma(-0.5, z, 1.0 - high)
    c = high + _fma(z * z, _polynomial(_COS, z), _fma(-r, rest, low))
    odd = _bit(t, 0)
    return _where(odd, c, s) / _where(odd, -s, c)


def _exp_parts(x: Scalar) -> tuple[Scalar, Scalar]:
    """(k, e^r - 1), where x = k ln 2 + r and k is whole."""
    t = _fma(x, 1.0 / math.log(2.0), _ROUND)
    k = t - _ROUND
    r = _fma(-k, _LN2[0], x)
    r = _fma(-k, _LN2[1], r)
    return k, _fma(r * r, _polynomial(_EXP, r), r)


def exp(x: Scalar) -> Scalar:
    """e to the power x."""
    held = _where(x < -750.0, -750.0, x)
    held = _where(held > 750.0, 750.0, held)
    k, p = _exp_parts(held)
    half = _unary("floor", k * 0.5)
    return (p + 1.0) * _unary("pow2", half) * _unary("pow2", k - half)


def log(x: Scalar) -> Scalar:
    """The natural logarithm: minus infinity at 0, not-a-number below."""
    small = x < 2.0**-1022
    scaled = _where(small, x * 2.0**54, x)
    k = _unary("exponent", scaled) - _where(small, 54.0, 0.0)
    m = _unary("significand", scaled)
    upper = m > math.sqrt(2.0)
    f = _where(upper, m * 0.5, m) - 1.0
    k = _where(upper, k + 1.0, k)
    s = f / (f + 2.0)
    z = s * s
    half_square = 0.5 * f * f
    rest = _fma(s, _fma(z, _polynomial(_LOG, z), half_square), k * _LN2_SPLIT[1])
    result = _fma(k, _LN2_SPLIT[0], f - (half_square - rest))
    result = _where(x > 0.0, result, _where(x == 0.0, -math.inf, math.nan))
    return _where(x < math.inf, result, x)


def tanh(x: Scalar) -> Scalar:
    """The hyperbolic tangent."""
    size = abs(x)
    doubled = 2.0 * _where(size > 22.0, 22.0, size)
    k, p = _exp_parts(doubled)
    scale = _unary("pow2", k)
    e = _fma(scale, p, scale - 1.0)
    return _flip(e / (e + 2.0), x, 63)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """The angle of the point (x, y), rad, in [-pi, pi]."""
    a, b = abs(y), abs(x)
    steep = a > b
    less, more = _where(steep, b, a), _where(steep, a, b)
    # scaled by a power of two: no sum overflows, and the bound of `upper` does not underflow
    scale = _where(more > 2.0**500, 2.0**-64, 2.0**64)
    less, more = less * scale, more * scale
    # the polynomial holds up to 7/16; above, the rest of the angle beyond atan(1/2), whose numerator is exact
    equal = less == more
    upper = (less > more * 0.4375) | (less == math.inf)
    beyond, around = _where(equal, 1.0, 2.0 * less - more), _where(equal, 3.0, 2.0 * more + less)
    t = _where(upper, beyond, less) / _where(upper, around, _where(equal, 1.0, more))
    z = t * t
    angle = _fma(t * z, _polynomial(_ATAN, z), t)
    angle = _where(upper, _ATAN_HALF[0] + (angle + _ATAN_HALF[1]), angle)
    angle = _where(steep, _PI[0] / 2 - (angle - _PI[1] / 2), angle)
    angle = _where(_bit(x, 63), _PI[0] - (angle - _PI[1]), angle)
    return _flip(angle, y, 63)


def atan(x: Scalar) -> Scalar:
    """The arc tangent, rad, in [-pi/2, pi/2]."""
    return atan2(x, Scalar(x.graph, x.graph.constant(1.0)))


def asin(x: Scalar) -> Scalar:
    """The arc sine, rad, in [-pi/2, pi/2]; not a number where |x| > 1."""
    return atan2(x, _other_leg(x))


def acos(x: Scalar) -> Scalar:
    """The arc cosine, rad, in [0, pi]; not a number where |x| > 1."""
    return atan2(_other_leg(x), x)


def _other_leg(x: Scalar) -> Scalar:
    """sqrt(1 - x^2): rounded only twice, so it is accurate where x is nearly 1 too."""
    return _unary("sqrt", _fma(-x, x, 1.0))
