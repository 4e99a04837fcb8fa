"""`met bed jitter`: how well exchanges keep their time. What depends on this machine's load is asserted loosely."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from batch.beds.jitter import duration, histogram, lines, off
from hw.bed import About, BedDriver, BedSample, BedState, Fault
from hw.driving import loop
from hw.driving.jitter import jitter_result
from hw.driving.pace import Pace
from hw.recording.records import ANSWERED, LATE_WOKEN, LAYOUT
from met import cli
from tests.batch.beds.listening import DECK, HELLO, READ, STOP, Listening

pytestmark = pytest.mark.alone

__all__ = ["DECK"]  # deck.ic


@pytest.fixture
def jitter(met_bed: Callable[..., tuple[int, str, str]]) -> Callable[..., tuple[int, str, str]]:
    """`met bed jitter ...`: exit status, what was said, and what was complained of."""
    return partial(met_bed, "jitter")


def test_a_bed_behind_a_pseudo_terminal(jitter: Callable[..., tuple[int, str, str]]) -> None:
    words = ("deck.ic", "wired", "--port", "firmware", "--rate", "500 Hz", "--duration", "1 s", "--format", "json")
    status, said, _ = jitter(*words)
    found = json.loads(said)
    assert status == (cli.NO if found["stops"] else cli.YES)
    assert (found["name"], found["rate_hz"], found["joints"]) == ("simulated", 500.0, 1)
    assert 20 < found["exchanges"] <= 500 and found["seconds"] < 5.0
    answered = found["exchanges"] - found["misses"]["unanswered"]
    assert sum(each["count"] for each in found["trip"]["histogram"]) == answered > 0
    assert sum(each["count"] for each in found["lateness"]["histogram"]) == found["exchanges"]
    trip = found["trip"]
    assert 0.0 < trip["median"] <= trip["high"] <= trip["highest"] <= trip["largest"]
    assert abs(found["clock"]) < 0.05


def test_so_many_exchanges_a_period_as_joints_and_none_of_them_a_command(
    jitter: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    device = Listening(lock_step=False)
    status, said, _ = jitter("--port", on_pty(device), "--rate", "100", "--joints", "2", "--duration", "0.5 s")
    assert status in (cli.YES, cli.NO)
    assert "not armed: " in said and " exchanges in 2 each period at 100 Hz in " in said
    assert set(device.kinds) == {HELLO, READ, STOP} and device.kinds.count(READ) > 10
    assert not any(value for _, value in device.outputs)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            "deck.ic wired --port emulated",
            """\
error[E426]: an emulated bed has no time of its own, so that nothing can be late
 = help: `--port firmware` has one, over a pseudo-terminal
""",
        ),
        (
            "--port firmware",
            """\
error[E425]: port `firmware` simulates a deck's bed, and there is no deck
 = help: give a deck, and the name of a run in it that substitutes a joint
""",
        ),
    ],
)
def test_what_is_wrong(jitter: Callable[..., tuple[int, str, str]], words: str, message: str) -> None:
    status, said, complaint = jitter(*words.split())
    assert (status, said) == (cli.BAD_INPUT, "")
    assert complaint.startswith(message)


def test_a_line_in_lock_step_has_no_time(
    jitter: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    status, _, complaint = jitter("--port", on_pty(Listening(lock_step=True)))
    assert status == cli.BAD_INPUT
    assert complaint.startswith("""\
error[E426]: bed `model` has no time of its own, so that nothing can be late
 = help: a line, or `--port firmware`, has one; `met bed run` drives it
""")


def test_a_bed_that_is_reset_meanwhile(jitter: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]) -> None:
    class Rebooting(Listening):
        def take(self, data: bytes) -> bytes:
            if self.boots == 1 and self.kinds.count(READ) > 20:
                self.boot()
            return super().take(data)

    status, _, complaint = jitter("--port", on_pty(Rebooting(lock_step=False)), "--rate", "100")
    assert status == cli.BAD_INPUT
    assert complaint.startswith("""\
error[E427]: bed `model` was reset while it was measured
 = help: look at its supply, and whether its watchdog resets it
""")


def test_a_line_that_is_too_slow_for_all_joints_is_refused(
    jitter: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    port = on_pty(Listening(lock_step=False))
    status, _, complaint = jitter("--port", port, "--rate", "1 kHz", "--joints", "2")
    assert status == cli.BAD_INPUT
    assert complaint.startswith(f"error[E405]: {port} at 921600 baud: an exchange takes 80% of its period of 0.5 ms")


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        ("fast", "`fast` is no rate: write `1 kHz` or `500 Hz`"),
        ("1 ms", "`1 ms` is no rate: write `1 kHz` or `500 Hz`"),
        ("0.1 Hz", "`0.1 Hz` is no rate to exchange at: 1 Hz to 100 kHz"),
    ],
)
def test_a_rate_that_is_none(jitter: Callable[..., tuple[int, str, str]], rate: str, message: str) -> None:
    status, _, complaint = jitter("--port", "/dev/nobody", "--rate", rate)
    assert status == cli.BAD_INPUT and message in complaint


# The loop, looking


class Watched(BedDriver):
    """A bed that answers, where `silent` does not say otherwise of the look; it may not be told anything."""

    def __init__(self, silent: Callable[[int], bool] = lambda n: False) -> None:
        self._silent, self.looks, self.stopped = silent, 0, False
        self.sample = BedSample(BedState.STOPPED, True, Fault.DEADMAN, False, 0, 0.0)

    def read(self) -> BedSample:
        return self.sample

    def look(self) -> BedSample | None:
        self.looks += 1
        return None if self._silent(self.looks) else self.sample

    def stop(self) -> bool:
        self.stopped = True
        return True

    def connect(self) -> About:
        raise AssertionError

    def arm(self) -> BedSample:
        raise AssertionError

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        raise AssertionError

    def limit(self, asked: Mapping[str, float]) -> None:
        raise AssertionError

    def clear(self) -> BedSample:
        raise AssertionError

    def rest(self, time: float) -> BedSample:
        raise AssertionError

    def close(self) -> None:
        raise AssertionError


def looked(bed: BedDriver, exchanges: int, hz: float = 1000.0) -> tuple[loop.LoopEnd, np.ndarray]:
    rows: list[bytes] = []
    ended = loop.drive(
        [bed], lambda e, rates, told: None, Pace(hz, 1), exchanges, rows.append, lock_step=False, armed=False
    )
    return ended, np.frombuffer(b"".join(rows), LAYOUT)


def test_looking_goes_on_through_silence_that_would_end_a_run() -> None:
    bed = Watched(silent=lambda n: 10 <= n < 20 or 30 <= n < 33)
    ended, rows = looked(bed, 40)
    assert ended == loop.LoopEnd(41) and bed.looks == 40 and bed.stopped
    assert ((rows["flags"] & ANSWERED) == 0).sum() == 13


def test_looking_goes_on_where_the_host_was_late_without_making_up_for_it() -> None:
    import time

    def slow(n: int) -> bool:
        if n == 5:
            time.sleep(0.05)
        return False

    ended, rows = looked(Watched(slow), 20)
    late = rows["began"] - rows["due"]
    assert ended.exchanges == 21
    assert late[6] >= 40e6 and rows["due"][7] - rows["due"][6] >= 40e6


def test_a_bed_that_was_reset_ends_it() -> None:
    bed = Watched()
    bed.sample = replace(bed.sample, greeted=False)
    assert looked(bed, 10)[0] == loop.LoopEnd(0, "the bed was reset", 0)


# Figures


def rows_of(count: int, *, silent: tuple[int, ...] = (), late: tuple[int, ...] = ()) -> np.ndarray:
    """Records of one bed at 1 kHz, each begun 3 us late and answered 0.1 ms after that."""
    rows = np.zeros(count, LAYOUT)
    rows["exchange"] = np.arange(count)
    rows["tick"] = 500 + np.arange(count)
    rows["flags"] = ANSWERED
    rows["due"] = 1_000_000 * np.arange(count)
    rows["began"] = rows["due"] + 3_000
    rows["ended"] = rows["began"] + 100_000
    for each in silent:
        rows["flags"][each] = 0
    for each in late:
        rows["began"][each] += 7_000_000
        rows["flags"][each] |= LATE_WOKEN
    return rows


def test_figures_of_records() -> None:
    found = jitter_result(rows_of(101), 1000.0, 1000.0)
    timing = found.timing
    assert (timing.exchanges, timing.unanswered, timing.woken, timing.waited, found.stops) == (100, 0, 0, 0, 0)
    assert timing.lateness.median == timing.lateness.highest == pytest.approx(3e-6)
    assert timing.trip.largest == pytest.approx(100e-6)
    assert abs(timing.drift) < 1e-9


def test_where_a_run_would_have_been_stopped() -> None:
    silent = (*range(10, 16), 30, 32, 34, *range(50, 54), *range(60, 65))
    assert jitter_result(rows_of(101, silent=silent), 1000.0, 1000.0).stops == 2  # of six, and of five; four are borne
    found = jitter_result(rows_of(101, late=(20, 40, 41)), 1000.0, 1000.0)
    assert (found.stops, found.timing.woken) == (3, 3)
    assert jitter_result(rows_of(3), 1000.0, 1000.0).stops == 0
    assert math.isnan(jitter_result(rows_of(3), 1000.0, 1000.0).timing.drift)


def test_bars_show_what_is_there_at_all() -> None:
    stretches = [(0.0, 1e-6, 0), (1e-6, 2e-6, 1000), (2e-6, 5e-6, 500), (5e-6, 1e-5, 0), (1e-5, None, 1)]
    assert histogram([{"from": a, "to": b, "count": count} for a, b, count in stretches]) == [
        "    < 2 us  1,000  " + "█" * 40,
        "    < 5 us    500  " + "█" * 20,
        "   < 10 us      0",
        "  >= 10 us      1  ▏",
    ]
    assert histogram([{"from": 0.0, "to": 1e-6, "count": 0}]) == ["  (none)"]


def test_times_in_three_digits() -> None:
    assert [duration(each) for each in (2.5e-6, 999.6e-6, 1e-3, 1.8e-3, 0.02, 3.0, None, math.nan)] == [
        "2.5 us",
        "1 ms",
        "1 ms",
        "1.8 ms",
        "20 ms",
        "3 s",
        "-",
        "-",
    ]


def test_how_far_a_clock_is_off() -> None:
    assert [off(each) for each in (5e-5, -1e-15, -9.9e-3, -0.5, 1.0, math.nan)] == [
        "+50 ppm",
        "+0 ppm",
        "-9,900 ppm",
        "-50 %",
        "+100 %",
        "not known",
    ]


def test_it_is_told() -> None:
    spread = {
        "median": 3e-6,
        "high": 5e-6,
        "highest": 1e-3,
        "largest": None,
        "histogram": [{"from": 2e-6, "to": 5e-6, "count": 9}],
    }
    data = {
        "name": "one",
        "port": "/dev/ttyUSB0",
        "exchanges": 12000,
        "joints": 3,
        "rate_hz": 1000.0,
        "seconds": 4.0,
        "lateness": spread,
        "trip": spread,
        "clock": 5e-5,
        "stops": 1,
        "misses": {"woken": 1, "computed": 0, "waited": 2, "unanswered": 3},
    }
    bar = "  < 5 us  9  " + "█" * 40
    assert lines(data) == [
        "bed `one` at /dev/ttyUSB0, not armed: 12,000 exchanges in 3 each period at 1000 Hz in 4 s",
        "",
        "late: median 3 us, p99 5 us, p99.9 1 ms, max -",
        bar,
        "",
        "answered in: median 3 us, p99 5 us, p99.9 1 ms, max -",
        bar,
        "",
        "a period late: 3 (woken too late 1, computing 0, waiting 2); unanswered: 3",
        "a run would have been stopped once, by five periods of lateness or silence",
        "the bed's clock against the computer's: +50 ppm",
    ]
