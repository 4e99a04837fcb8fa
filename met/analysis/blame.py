"""The servo loop that causes an instability, and the change of it that would help, for loops closed over the arm.

A loop is to blame for modes that grow with its gain and do not grow without it. Modes that fall or drift without the
loop are not counted. Of many loops, only those that matter most to the fastest such modes are tried: a spectrum for
each loop would take longer than the run.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from operator import itemgetter

import numpy as np

from met.analysis.loops import WHOLE, Gains, parts_in, rates_of, spectrum, uncoupled
from met.analysis.step_map import Linearizer, SampledLoops
from met.frozen import frozen

SMALLEST, LARGEST = 1e-3, 30.0
"""Smallest and largest share of a gain between which a stable one is searched for."""

POOR = 0.02
"""Share of a gain up to which a stable one helps little, so that single numbers of the law are tried."""

STRIDE = 0.8
"""Ratio of one tried gain to the one before."""

WORSE = 1.5
"""Factor over the growth without a loop above which the loop is to blame although the arm grows without it too."""

TRIED, TRIED_OF_MANY = 8, 3
"""Largest number of loops that are tried, and of modes that they are chosen by, of an arm and of one above
`met.analysis.loops.WHOLE`."""

COARSE = 0.5, 1.05
"""As `STRIDE`, and the factor to which a share is found, for an arm above `met.analysis.loops.WHOLE`."""

LARGEST_FITTED = 1200
"""States and memory of an arm above which no stable share of a gain is searched for."""

BY_TICKS = 2.0
"""Factor over the growth of the arm with laws that have no ticks, above which the ticks are to blame."""


@frozen
class Unstable:
    """Loops that are unstable at one pose of one case.

    joints  whose loops: of one the gain alone is to blame; of several those of all of them together
    gain    share of the gains up to which it is stable, as far as all else stays, or above 1, from which on; None:
            none; not a number: none was searched for
    every   s in which a disturbance grows by e
    ticks   whether it would not be so if the laws had no ticks and no delays of them
    sensed  whether it would not be so if the laws saw what is so, without their sensors
    weak    whether it falls as it would without the loop, which with more gain would hold it
    rubs    whether dry friction is on these joints, which is left out
    parameters  of one joint's loop that is unstable by itself, or no gain of which fits well: the numbers of its law
            that do it alone, by name, each with a share as the gain's
    """

    case: int
    joints: tuple[str, ...]
    gain: float | None
    every: float
    ticks: bool = True
    sensed: bool = False
    weak: bool = False
    rubs: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)


def closed(
    linearizer: Linearizer, loops: SampledLoops, lanes: Iterable[tuple[int, float, bool]]
) -> tuple[Unstable, ...]:
    """The loops that make lanes grow, the one that needs the largest change first; lanes: as from
    `met.analysis.loops.growing`."""
    several, seen, opened = dict[tuple[str, ...], Unstable](), set[str](), Opened(linearizer, loops)
    for lane, limit, ticks in lanes:
        case = opened.lane(lane, limit, ticks)
        concerned = case.concerned()
        if seen and concerned <= seen:
            continue
        seen |= concerned
        for unstable in opened.blamed(case):
            several.setdefault(unstable.joints, unstable)
    return tuple(sorted(several.values(), key=needs))


def needs(unstable: Unstable) -> tuple[float, float]:
    """Sort key of a finding: the smaller, the larger the change that is needed."""
    return _change(unstable.gain), unstable.every


def _change(share: float | None) -> float:
    """A measure of how little a gain has to change: the larger, the smaller the change."""
    return 0.0 if share is None or math.isnan(share) else min(share, 1.0 / share)


@frozen
class _Growing:
    """Modes that grow: their rates, 1/s, the largest first."""

    rates: tuple[float, ...]

    @property
    def count(self) -> float:
        return math.inf if math.inf in self.rates else len(self.rates)

    def adds_to(self, without: _Growing, limit: float, times: float = WORSE) -> bool:
        """True where more modes grow than without a part of the loop, or where they grow faster."""
        return self.count > without.count or sum(self.rates) > times * sum(without.rates) + limit

    def beyond(self, without: _Growing) -> float:
        """The largest growth rate that does not occur without a loop."""
        left = list(self.rates)
        for rate in without.rates[: max(0, len(left) - 1)]:
            left.remove(min(left, key=lambda candidate: abs(candidate - rate)))
        return max(left)


@frozen
class Lane:
    """The loops of one lane.

    limit  rate above which a mode counts as growing, 1/s;  ticks: whether those of laws have a part in it
    """

    loops: SampledLoops
    lane: int
    limit: float
    ticks: bool
    _spectra: dict[tuple[object, ...], np.ndarray] = field(default_factory=dict, compare=False)

    @cached_property
    def _parts(self) -> tuple[SampledLoops, ...]:
        return uncoupled(self.loops, 0)

    @cached_property
    def size(self) -> int:
        """States and memory of the largest part that is coupled."""
        return max(part.states + len(part.held) for part in self._parts)

    def growing(
        self,
        gains: Gains | None = None,
        *,
        above: float = 1.0,
        direct: bool = False,
        ticks: bool | None = None,
    ) -> _Growing:
        """Modes that grow, with these shares of gains; above: this share of the limit."""
        ticks = self.ticks if ticks is None else ticks
        rates = np.concatenate([rate for _, _, rate in self._modes(gains or {}, ticks, direct)])
        return _Growing(tuple(sorted(rates[rates > above * self.limit].tolist(), reverse=True)))

    def _modes(
        self, gains: Gains, ticks: bool, direct: bool = False
    ) -> Iterator[tuple[SampledLoops, np.ndarray, np.ndarray]]:
        """Each part with its eigenvalues and their growth rates, which are kept: most gains leave most parts as they
        were."""
        for number, part in enumerate(self._parts):
            key = number, ticks, direct, tuple(gains.get(law.joint, 1.0) for law in part.laws)
            if key not in self._spectra:
                (self._spectra[key],) = spectrum(part, np.array([self.lane]), gains, ticks=ticks, direct=direct)
            yield part, self._spectra[key], rates_of(part, self._spectra[key], ticks=ticks)

    def telling(self, gains: Gains | None = None) -> tuple[str, ...]:
        """The joints whose loops are tried: all of a small arm, else those that matter most to the fastest modes that
        grow, and to modes of laws without ticks beside others that tick."""
        joints = [law.joint for law in self.loops.laws]
        most = TRIED if self.size <= WHOLE else TRIED_OF_MANY
        if len(joints) <= most:
            return tuple(joints)
        largest_shares: dict[str, float] = {}
        mixed = self.ticks and any(law.continuous for law in self.loops.laws)
        for ticks in (True, False) if mixed else (self.ticks,):
            modes = [
                (rate, complex(value), part)
                for part, values, rates in self._modes(gains or {}, ticks)
                for value, rate in zip(values.tolist(), rates.tolist(), strict=True)
                if self.limit < rate < math.inf and value.imag >= 0.0
            ]
            for _, value, part in heapq.nlargest(most, modes, key=itemgetter(0)):
                shares = parts_in(part, self.lane, gains, value, ticks=ticks)
                whole = sum(shares.values()) or 1.0
                for joint, share in shares.items():
                    largest_shares[joint] = max(largest_shares.get(joint, 0.0), share / whole)
        chosen = heapq.nlargest(most, largest_shares, key=lambda joint: round(largest_shares[joint], 6))
        return tuple(joint for joint in joints if joint in chosen)

    def without(self, own: _Growing, joints: Sequence[str], gains: Gains | None = None) -> _Growing | None:
        """The growth without the loops of these joints, where it is less than with them; None where it is not."""
        growth = self.growing({**(gains or {}), **dict.fromkeys(joints, 0.0)}, above=0.5)
        return growth if own.adds_to(growth, self.limit) else None

    def concerned(self) -> frozenset[str]:
        """The joints whose loops are each to blame without the others."""
        own = self.growing()
        return frozenset(joint for joint in self.telling() if self.without(own, (joint,)) is not None)

    def blamed(self) -> list[Unstable]:
        """The loops that make the lane grow; none where they do not.

        Among loops that are unstable together, the one whose gain has to change least comes first, then those that are
        still unstable.
        """
        own = self.growing()
        if not 0 < own.count < math.inf:
            return []
        together = tuple(law.joint for law in self.loops.laws)
        gains: dict[str, float] = {}
        findings: list[Unstable] = []
        while len(gains) < len(together):
            now = self.growing(gains)
            groups: list[tuple[str, ...]] = [(joint,) for joint in self.telling(gains) if joint not in gains]
            at_fault = {which: base for which in groups if (base := self.without(now, which, gains)) is not None}
            if not at_fault and not findings and len(together) > 1:
                base = self.without(now, together)
                at_fault = {} if base is None else {together: base}
            if not at_fault:
                break
            fits = {which: self._gain(now, base, which, gains) for which, base in at_fault.items()}
            which = max(fits, key=lambda which: _change(fits[which]))
            findings.append(self._unstable(own, which, fits[which], now.beyond(at_fault[which])))
            if self.size > WHOLE:
                break  # the next check tells the next
            gains |= dict.fromkeys(which, fits[which] or 0.0)
        return findings or self._too_weak(own)

    def _gain(self, own: _Growing, without: _Growing, joints: Sequence[str], gains: Gains) -> float | None:
        """The share of these joints' gains at which fewer modes grow than now, and no more than without their loops;
        None where there is none.

        own      what grows with the loops as they are;  without: with those of these joints taken away
        """

        def count(share: float) -> float:
            return self.growing({**gains, **dict.fromkeys(joints, share)}).count

        return self._fitting(count, min(without.count, own.count - 1))

    def _fitting(self, count: Callable[[float], float], aim: float) -> float | None:
        """The share of gains at which at most `aim` modes grow (`fitting`), coarse for large arms; not a number for
        those too large to try."""
        if self.size > LARGEST_FITTED:
            return math.nan
        return fitting(count, aim, *(COARSE if self.size > WHOLE else ()))

    def _unstable(self, own: _Growing, joints: tuple[str, ...], gain: float | None, rate: float) -> Unstable:
        """The loops to blame, and whether their ticks or their sensors cause it."""
        ticks, sensed = False, any(law.joint in joints and law.direct.shape[1] for law in self.loops.laws)
        if self.ticks:
            analog = self.growing(above=0.5, ticks=False)
            ticks = analog.count == math.inf or own.adds_to(analog, 0.0, BY_TICKS)
        sensed = sensed and self.growing(above=0.5, direct=True).count < own.count
        return Unstable(int(self.loops.case[self.lane]), joints, gain, 1.0 / rate, ticks, sensed)

    def _too_weak(self, own: _Growing) -> list[Unstable]:
        """The position loops that do not hold a load which falls without them, and would hold it with more gain."""
        findings, tried = [], self.telling()
        for law in self.loops.laws:
            if law.joint not in tried or self.size > LARGEST_FITTED:
                continue

            def count(share: float, joint: str = law.joint) -> float:
                return self.growing({joint: share}).count

            gain = self._fitting(count, own.count - 1) if law.command == "position" else None
            if gain is not None and gain > 1.0:
                every = 1.0 / max(own.rates)
                findings.append(
                    Unstable(int(self.loops.case[self.lane]), (law.joint,), gain, every, ticks=False, weak=True)
                )
        return findings


class Opened:
    """The loops of an experiment's cases, opened so that every gain can be scaled, those of continuous laws too."""

    def __init__(self, linearizer: Linearizer, loops: SampledLoops) -> None:
        self._linearizer, self._loops = linearizer, loops
        self._rubs = frozenset(sticking.name.partition(".")[0] for sticking in linearizer.builder.step.sticking)

    @cached_property
    def _opened(self) -> Linearizer:
        own = self._linearizer
        return own.opened() if own.continuous else own

    @cached_property
    def loops(self) -> SampledLoops:
        return self._loops if not self._linearizer.continuous else self._with({})

    def _with(self, scaled: Mapping[str, Mapping[str, float]]) -> SampledLoops:
        loops = self._opened.sampled(scaled=scaled)
        assert loops is not None
        return loops

    def lane(self, lane: int, limit: float, ticks: bool) -> Lane:
        return Lane(self.loops, lane, limit, ticks)

    def blamed(self, lane: Lane) -> list[Unstable]:
        """The loops that make a lane grow, with what helps."""
        several = (replace(unstable, rubs=not self._rubs.isdisjoint(unstable.joints)) for unstable in lane.blamed())
        return [
            unstable if unstable.ticks and (unstable.gain or 0.0) > POOR else self._remedied(lane, unstable)
            for unstable in several
        ]

    def _remedied(self, lane: Lane, unstable: Unstable) -> Unstable:
        """The findings with the parameters that help, each tried alone."""
        if len(unstable.joints) > 1 or lane.size > WHOLE:
            return unstable
        (joint,), own = unstable.joints, lane.growing()
        aim = min(own.count - 1, lane.growing({joint: 0.0}).count)
        several = {}
        for gain in self._opened.gains(joint):

            def count(share: float, name: str = gain.name) -> float:
                scaled = Lane(self._with({joint: {name: share}}), lane.lane, lane.limit, lane.ticks)
                return scaled.growing().count

            share = fitting(count, aim)
            if share is not None:
                several[gain.name] = share
        return replace(unstable, parameters=several)


def fitting(count: Callable[[float], float], aim: float, stride: float = STRIDE, exact: float = 1.001) -> float | None:
    """The largest share below 1 at which at most `aim` modes grow, by `count`, to the factor `exact`; else the
    smallest above 1; None where there is none."""
    for factor in (stride, 1.0 / stride):
        bad, good = 1.0, factor
        while count(good) > aim:
            bad, good = good, good * factor
            if not SMALLEST <= good <= LARGEST:
                break
        else:
            while max(bad, good) > exact * min(bad, good):
                middle = math.sqrt(bad * good)
                bad, good = (middle, good) if count(middle) > aim else (bad, middle)
            return good
    return None
