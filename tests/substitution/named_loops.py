"""The loops on beds whose stability tests and pages name, by a name that says law, rate, delay, filter and servo."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from met.plan import Experiment
from tests.substitution.hybrid import compiled

DELAYS = (0, 1, 2)

THERE = """
#include <two_link.ic>
servo pushed like rigid_gearbox {{ {servo} }}
run there like nominal {{
    servos     {{ shoulder = pushed;  elbow = rigid_gearbox {{ command = rate(0.03 rad/s); }} }}
    substitute shoulder {{ bed = emulated({bed});  law = {law}; }}
    rates      {{ base = {rate} Hz; dynamics = {rate} Hz; servos = {rate} Hz; record = {rate} Hz; }}
    duration   = 1 s;
}}
sweep delays of there {{ vary shoulder.bed.delay = {delays}; }}
"""

LAWS = ("torque_balance", "torque_balance_observer", "velocity_tracking", "velocity_tracking(gain = 0.6)")

ASKED = "command = rate(0.03 rad/s);"
"""What a servo is told, where a loop's name says nothing of it."""


Sweep = tuple[str, str, int, Sequence[int], str, str]


def sweeps() -> Iterator[Sweep]:
    """Name, law, rate in Hz, delays in ticks, bed and servo of each sweep over delays."""
    # the map of docs/linear.md
    for rate in (50, 100, 200, 500, 1000, 2000, 5000):
        yield f"measured_acceleration at {rate} Hz", "measured_acceleration", rate, DELAYS, "", ASKED
    # the laws below it, of which no limit was found
    for law in LAWS:
        for rate in (100, 1000):
            yield f"{law} at {rate} Hz", law, rate, DELAYS, "", ASKED
    # other filters
    for cut in (20, 100):
        for rate in (100, 200, 1000):
            name = f"measured_acceleration at {rate} Hz, filter {cut} Hz"
            yield name, "measured_acceleration", rate, DELAYS, f"f_cut = {cut} Hz", ASKED
    yield (
        "measured_acceleration at 1000 Hz, filter 200 Hz",
        "measured_acceleration",
        1000,
        (0,),
        "f_cut = 200 Hz",
        ASKED,
    )
    # servos with much gain, which need a heavy arm; other commands
    stiff = f"kp = 1 V*s/rad;  {ASKED}"
    yield "measured_acceleration at 1000 Hz, kp = 1", "measured_acceleration", 1000, (0,), "", stiff
    yield "velocity_tracking at 1000 Hz, kp = 1", "velocity_tracking", 1000, (1,), "", stiff
    yield "torque_balance_observer at 500 Hz, kp = 1", "torque_balance_observer", 500, (1,), "", stiff
    place = "k_position = 10 1/s;  command = position(0.1 rad);"
    yield "velocity_tracking at 1000 Hz, k_position = 10", "velocity_tracking", 1000, (0,), "", place
    fast = "k_position = 30 1/s;  command = position(0.1 rad);"
    yield "velocity_tracking at 1000 Hz, k_position = 30", "velocity_tracking", 1000, (0,), "", fast
    pushed = "command = torque(1 N*m);"
    yield "measured_acceleration at 1000 Hz, torque", "measured_acceleration", 1000, (0,), "", pushed
    pull = f"ratio = 20000;  {ASKED}"
    yield "velocity_tracking at 1000 Hz, gain 3", "velocity_tracking(gain = 3)", 1000, (0,), "", pull
    yield "bare at 1000 Hz", "bare", 1000, DELAYS, "", ASKED


def named(sweep: Sweep) -> tuple[list[str], Experiment]:
    """The names of a sweep's cases, and it."""
    name, law, rate, delays, bed, servo = sweep
    text = THERE.format(law=law, rate=rate, delays=list(delays), bed=bed, servo=servo)
    return [f"{name}, delay {delay}" for delay in delays], compiled(text, "delays")
