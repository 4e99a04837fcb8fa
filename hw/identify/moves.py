"""The moves for identifying a bed: each begins and ends at rest, so that each can be analysed alone.

steps      of the voltage, both ways, at several levels, and back to 0 V: inertia, and what brakes the shaft
loaded     the same under steps of the load's current: the torque that all others are measured by
slow       ramps of voltage, and of current, through rest: dry friction, misalignment
limited    the largest voltage and 0 V by turns, as the rate goes up and down: the drive's largest torque, and with
           it what of the braking is friction and what back-EMF
mixed      three sines of the voltage and two of the current
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from met.frozen import frozen

SLOW = 2.0
"""rad/s: a shaft that has been slower for `STILL` s without voltage and current is at rest."""
STILL = 0.08
PATIENCE = 3.0
"""Longest time to wait for a shaft to come to rest, s."""
REST = -1
"""The number for no move: for commands after the last one."""


@frozen
class Peaks:
    """The largest voltage (V) and current (A) of the moves, and the rate (rad/s) above which a move is over."""

    voltage: float
    current: float
    rate: float


Profile = Callable[[float, float], tuple[float, float]]
"""A move's commands: (time from its beginning s, rate rad/s) -> voltage and current, as shares of the peaks."""


@frozen
class Move:
    """One move. name: its kind;  time: s, before it comes to rest"""

    name: str
    time: float
    profile: Callable[[], Profile]


def guided(top: float) -> tuple[Move, ...]:
    """All moves, in their order. top: rate up to which the `limited` ones go, rad/s."""
    return (*_steps(), *_loaded(), *_slow(), *_limited(top), *_mixed())


GROUPS = 8


def groups(moves: Sequence[Move]) -> list[int]:
    """The group of each move. Each of the `GROUPS` has moves of every kind, so that all parameters follow from one
    group."""
    seen: dict[str, int] = {}
    numbers = []
    for move in moves:
        numbers.append(seen.get(move.name, 0) % GROUPS)
        seen[move.name] = seen.get(move.name, 0) + 1
    return numbers


def _levels(every: float, *levels: tuple[float, float]) -> Callable[[], Profile]:
    return lambda: lambda t, w: levels[min(int(t / every), len(levels) - 1)]


def _steps() -> list[Move]:
    """Moves of two levels of voltage without load, with both signs."""
    pairs = [(0.15, 0.4), (0.3, -0.3), (0.6, 0.2), (0.5, -0.15), (0.25, 0.7), (0.1, -0.12), (0.2, -0.5), (0.35, 0.12)]
    return [
        Move("steps", 0.6, _levels(0.3, (sign * a, 0.0), (sign * b, 0.0))) for a, b in pairs for sign in (1.0, -1.0)
    ]


def _loaded() -> Iterator[Move]:
    """Moves at one voltage under several currents of the load."""
    for volts, amperes in [(0.3, 0.5), (0.5, -0.6), (0.15, 0.35), (0.4, 0.25)]:
        for sign in (1.0, -1.0):
            v, a = sign * volts, sign * amperes
            yield Move("loaded", 0.8, _levels(0.2, (v, 0.0), (v, a), (v, -a), (v, 0.5 * a)))


def _slow() -> Iterator[Move]:
    """Slow sines of the voltage, and of the current, through rest: for dry friction and misalignment."""

    def ramps(volts: float, amperes: float, time: float) -> Callable[[], Profile]:
        """A move's profile: one slow sine of voltage and current through rest, `time` s long."""

        def profile(t: float, w: float) -> tuple[float, float]:
            turn = math.sin(2.0 * math.pi * t / time)
            return volts * turn, amperes * turn

        return lambda: profile

    for share in (1.0, -1.0):
        yield from [
            Move("slow", 1.6, ramps(share * 0.12, 0.0, 1.6)),
            Move("slow", 1.6, ramps(share * 0.25, 0.0, 0.8)),
            Move("slow", 1.6, ramps(0.0, share * 0.6, 1.6)),
            Move("slow", 1.2, ramps(0.0, share * 0.9, 0.6)),
        ]


def _limited(top: float) -> list[Move]:
    """The largest voltage and 0 V by turns, as the rate goes up and down between shares of `top`, rad/s, under several
    loads."""

    def relay(sign: float, load: float, low: float, high: float) -> Callable[[], Profile]:
        """A move's profile that switches the drive on and off, so that the rate stays between `low` and `high`."""

        def new_profile() -> Profile:
            """The profile of one run of the move, which begins with the drive on."""
            up = True

            def profile(t: float, w: float) -> tuple[float, float]:
                nonlocal up
                up = sign * w < (high if up else low)
                return (sign if up else 0.0), sign * load

            return profile

        return new_profile

    return [
        Move("limited", 0.8, relay(sign, load, low * top, high * top))
        for load, low, high in [(0.0, 0.4, 1.0), (0.35, 0.5, 0.9), (-0.35, 0.3, 0.9), (0.0, 0.6, 0.95)]
        for sign in (1.0, -1.0)
    ]


def _mixed() -> list[Move]:
    """Sums of three sines of the voltage and two of the current, for several sets of frequencies, both ways."""

    def sines(volts: Sequence[float], amperes: Sequence[float], hertz: Sequence[float]) -> Callable[[], Profile]:
        """A move's profile of sines: three of the voltage and the others of the current, with these amplitudes and
        frequencies."""

        def profile(t: float, w: float) -> tuple[float, float]:
            """Shares of the largest voltage and current at time t, s, after the move's begin. w: rate of the shaft, not
            used"""
            waves = [math.sin(2.0 * math.pi * f * t) for f in hertz]
            return (
                sum(a * wave for a, wave in zip(volts, waves[:3], strict=True)),
                sum(a * wave for a, wave in zip(amperes, waves[3:], strict=True)),
            )

        return lambda: profile

    tones = [
        (1.3, 3.1, 7.9, 2.3, 5.7),
        (0.9, 2.7, 11.3, 1.7, 8.3),
        (1.9, 4.3, 13.7, 3.7, 6.1),
        (2.9, 5.3, 9.1, 1.1, 10.7),
    ]
    return [
        Move("mixed", 1.2, sines((sign * 0.3, 0.2, sign * 0.15), (0.3, sign * 0.3), tone))
        for tone in tones
        for sign in (1.0, -1.0)
    ]


class MoveGuide:
    """Leads a bed through the moves (`hw.driving.loop.Compute`). period: s, from exchange to exchange; slews: V/s, A/s.

    began  of each move, the exchange whose answer found the bed at rest, from which on it was told the move
    done   whether all were made, and the bed is at rest
    stuck  whether a move was not over in time: the bed does not come to rest
    """

    def __init__(self, moves: Sequence[Move], peaks: Peaks, period: float, slews: tuple[float, float]) -> None:
        self._moves, self._peaks, self._period = moves, peaks, period
        self._most = tuple(slew * period for slew in slews)
        self.began: list[int] = []
        self.done = self.stuck = False
        self._profile: Profile | None = None
        self._since = self._waited = 0  # exchanges: of rest, or of the move; since the last move

    @property
    def exchanges(self) -> int:
        """The largest number of exchanges that the moves may take."""
        return sum(math.ceil((move.time + PATIENCE) / self._period) + 1 for move in self._moves) + 1

    def __call__(self, e: int, rates: Sequence[float], commands: list[list[float]]) -> None:
        """Set the commands of exchange `e`: of the move under way, with limited slews, or of the rest before the
        next."""
        rate, wanted = rates[0], (0.0, 0.0)
        if self._profile is None:
            self._rest(e, rate, commands[0])
        if self._profile is not None:
            time = self._since * self._period
            if time >= self._moves[len(self.began) - 1].time - 1e-9 or abs(rate) > self._peaks.rate:
                self._profile, self._since, self._waited = None, 0, 0
            else:
                volts, amperes = self._profile(time, rate)
                wanted = volts * self._peaks.voltage, amperes * self._peaks.current
                self._since += 1
        for n, (value, most) in enumerate(zip(wanted, self._most, strict=True)):
            commands[0][n] += min(max(value - commands[0][n], -most), most)

    def _rest(self, e: int, rate: float, commands: Sequence[float]) -> None:
        """Begin the next move where the bed has been at rest for long enough."""
        still = abs(rate) <= SLOW and commands[0] == 0.0 and commands[1] == 0.0
        self._since = self._since + 1 if still else 0
        self._waited += 1
        if self._since * self._period >= STILL:
            if len(self.began) == len(self._moves):
                self.done = True
            else:
                self._profile, self._since = self._moves[len(self.began)].profile(), 0
                self.began.append(e)
        elif self._waited * self._period >= PATIENCE:
            self.stuck = True
