"""Where the loop of bed, filter, servo and law begins to grow: found by sweeps of runs, and told by `met margin`.

One rod on one joint, so r is exact. A loop that grows swings at a frequency near the tick's: it shows in the second
difference of (shaft rate - rate of the same joint on its own motor), which in a stable loop dies away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from met.analysis.margin import margins
from tests.oracles.worst import Worst
from tests.substitution.hybrid import RATIO, ROTOR, compiled, deck, inertias, loads, r_of, ran, shaft

slow = pytest.mark.slow
REACH = 2.0  # m, length of the rod
ONE = (
    "one_rod",
    ("shoulder",),
    """
    let load = 100 kg;
    arm one_rod {
        link upper { mass = load; shape = rod(length = reach, along = x); }
        joint shoulder revolute { parent = base; child = upper; axis = z; }
    }
""",
)

# The limits of an independent model for measured acceleration, 50 Hz filter, by rate in Hz and delay in ticks.
INDEPENDENT = {(100, 0): 2.05, (1000, 0): 5.4, (100, 1): 1.25, (1000, 1): 2.85}


def grows(own: np.ndarray, bench: np.ndarray, rows: int) -> np.ndarray:
    """Whether the bench swings in its last rows and did not swing more in as many before: of all axes but the last.

    Rates of the joint, rad/s. A stable loop leaves less than 1e-3 rad/s of the shaft; one that dies away slowly loses
    more than a tenth in the time that these tests give it; one that has grown to its limits swings by some rad/s, now
    more, now less. A mean and no rms: a drive that leaves its torque limit bends the course once, which is no swing.
    """
    bends = RATIO * np.abs(np.diff(bench - own, 2, axis=-1))
    last, before = (np.mean(part, axis=-1) for part in (bends[..., -rows:], bends[..., -2 * rows : -rows]))
    found: np.ndarray = (last > 0.1) | ((last > 1e-2) & (last > 0.9 * before))
    return found


def swept(law: str, rate: int, swept: str, heaviness: Sequence[float], duration: float) -> tuple[str, np.ndarray]:
    """A deck, and whether each of its cases grows: (other axes of the sweep, r)."""
    masses = ", ".join(f"{r * ROTOR * 3.0 / REACH**2:.12g}" for r in heaviness)
    text = deck(
        law=law,
        servos=rate,
        dynamics=rate,
        duration=duration,
        arm=ONE,
        sweep=f"vary load = [{masses}] kg;",
        swept=swept,
    )
    own = ran(text, "own").signals["qd"][:, :, 0]
    bench = shaft(ran(text, "bench"), "shoulder").reshape(-1, *own.shape)
    return text, grows(own, bench, round(duration * rate / 8.0))


@pytest.mark.release
@pytest.mark.parametrize(
    ("rate", "duration", "delays", "cuts"),
    [
        (100, 8.0, (0, 1), (50,)),
        (1000, 4.0, (0, 1), (50,)),
        *(
            pytest.param(rate, duration, (0, 1, 2), (20, 50, 100), marks=slow)
            for rate, duration in ((100, 8.0), (200, 8.0), (1000, 4.0))
        ),
    ],
)
def test_measured_acceleration_grows_from_where_the_margin_and_an_independent_model_say(
    rate: int, duration: float, delays: tuple[int, ...], cuts: tuple[int, ...]
) -> None:
    heaviness = np.geomspace(0.8, 16.0, 121)  # 2.5 % apart
    text, found = swept(
        "measured_acceleration",
        rate,
        f"vary shoulder.bed.delay = {list(delays)}; vary shoulder.bed.f_cut = {list(cuts)} Hz;",
        heaviness,
        duration,
    )
    bench = compiled(text, "bench")
    ahead = Worst(f"limit at {rate} Hz, found against predicted, as a share")
    known = Worst(f"limit at {rate} Hz, found against an independent model, as a share")
    for i, delay in enumerate(delays):
        for j, cut in enumerate(cuts):
            number = i * len(cuts) + j
            first = int(found[number].argmax())
            assert first > 0 and found[number, first:].all(), "stable below one r, and not above it"
            limit = float(np.sqrt(heaviness[first - 1] * heaviness[first]))
            predicted = margins(bench, [number * len(heaviness)])[0][0].limit
            assert predicted is not None
            where = f"delay {delay}, filter {cut} Hz: found {limit:.3g}, predicted {predicted:.3g}"
            print(f"{rate} Hz, {where}")
            ahead.see(abs(limit / predicted - 1.0), where)
            if cut == 50 and (rate, delay) in INDEPENDENT:
                known.see(abs(limit / INDEPENDENT[rate, delay] - 1.0), where)
    ahead.below(0.1)
    if known.count:
        known.below(0.1)


@pytest.mark.release
@pytest.mark.parametrize("rate", [100, 200, 1000])
def test_half_a_percent_to_each_side_of_a_limit_runs_die_away_and_grow(rate: int) -> None:
    """Nine limits a rate: three delays, three filters. The shaft's second difference is the loop's swing; one that
    grows comes to the motor's limits, some rad/s of the shaft."""
    pairs = [(delay, cut) for delay in (0, 1, 2) for cut in (20, 50, 100)]
    swept = ", ".join(str(delay) for delay, _ in pairs for _ in "-+")
    cuts = ", ".join(str(cut) for _, cut in pairs for _ in "-+")
    asked = f"shoulder.bed.delay = [{swept}];  shoulder.bed.f_cut = [{cuts}] Hz;"

    def with_loads(ratios: Sequence[float]) -> str:
        loads = ", ".join(f"{r * ROTOR * 3.0 / REACH**2:.12g}" for r in ratios)
        law, zipped = "measured_acceleration", f"zip {{ {asked}  load = [{loads}] kg; }}"
        return deck(law=law, servos=rate, dynamics=rate, duration=20.0, arm=ONE, swept=zipped)

    limits = [one.limit for (one,) in margins(compiled(with_loads([1.0 + 0.01 * k for k in range(18)]), "bench"))]
    ratios = [limit * side for limit, side in zip(limits, (0.995, 1.005) * 9, strict=True) if limit is not None]
    bench = RATIO * shaft(ran(with_loads(ratios), "bench"), "shoulder")
    bends = np.abs(np.diff(bench, 2, axis=-1))
    quarters = np.array([part.mean(axis=-1) for part in np.array_split(bends, 4, axis=-1)]).T.reshape(9, 2, 4)
    below, above = quarters[:, 0], quarters[:, 1]
    assert (below[:, 3] < 0.6 * below[:, 1]).all() and (below[:, 3] < 0.1).all(), below
    assert (above[:, 3] > 0.9 * above[:, 1]).all() and (above[:, 3] > 0.1).all(), above


@pytest.mark.release
@pytest.mark.parametrize("law", ["velocity_tracking", "torque_balance", "torque_balance_observer"])
@pytest.mark.parametrize(
    ("rate", "delays", "cuts"),
    [
        (1000, (1,), (50,)),
        *(pytest.param(rate, (0, 1, 2), (20, 50, 100), marks=slow) for rate in (100, 200, 1000)),
    ],
)
def test_no_other_law_grows_however_heavy_the_arm(
    law: str, rate: int, delays: tuple[int, ...], cuts: tuple[int, ...]
) -> None:
    heaviness = np.geomspace(0.1, 1000.0, 21)
    text, found = swept(
        law,
        rate,
        f"vary shoulder.bed.delay = {list(delays)}; vary shoulder.bed.f_cut = {list(cuts)} Hz;",
        heaviness,
        4.0,
    )
    assert found.shape == (len(delays) * len(cuts), 21) and not found.any()
    first_of_each = range(0, found.size, found.shape[1])
    assert [each[0].limit for each in margins(compiled(text, "bench"), first_of_each)] == [None] * len(found)


@pytest.mark.release
@pytest.mark.parametrize("rate", [100, 1000])
def test_the_gain_of_velocity_tracking_has_the_limit_that_the_margin_says(rate: int) -> None:
    """With a delay: without one there is none up to 1.6. r = 5; it hardly matters."""
    delays, gains = (0, 1, 2), np.linspace(0.4, 1.6, 49)
    listed = ", ".join(f"{gain:.6g}" for gain in gains)
    text, found = swept(
        "velocity_tracking",
        rate,
        f"vary shoulder.bed.delay = {list(delays)}; vary shoulder.law.gain = [{listed}];",
        [5.0],
        6.0,
    )
    grown = found.reshape(len(delays), len(gains))
    bench = compiled(text, "bench")
    assert not grown[0].any()
    for i in (1, 2):
        first = int(grown[i].argmax())
        assert first > 0 and grown[i, first:].all()
        low, high = (
            margins(bench, [i * len(gains) + int(np.abs(gains - share * gains[first]).argmin())])[0][0].stable
            for share in (0.9, 1.1)
        )
        print(f"{rate} Hz, delay {delays[i]}: grows from gain {gains[first]:.3g}")
        assert low and not high


@pytest.mark.slow
def test_joints_by_measured_acceleration_together_grow_by_the_largest_r_of_all_their_motions() -> None:
    """The largest eigenvalue of Lambda/(N^2 J_m) counts, not each joint by itself: 5.4 as of one joint alone."""
    heavier = np.linspace(2.4, 4.2, 73)
    wanted = [float(r) for r in np.linalg.eigvalsh([inertias(each) / ROTOR for each in heavier])[:, -1]]
    masses = [", ".join(f"{mass * each:.9g}" for each in heavier) for mass in (40.0, 20.0)]
    text = deck(
        ("shoulder", "elbow"),
        law="measured_acceleration",
        duration=5.0,
        sweep=f"zip {{ links.upper.mass = [{masses[0]}] kg;  links.lower.mass = [{masses[1]}] kg; }}",
    )
    own, bench = ran(text, "own"), ran(text, "bench")
    worst = Worst("largest r of two joints where they grow, against 5.4, as a share")
    for number, joint in enumerate(("shoulder", "elbow")):
        found = grows(own.signals["qd"][:, :, number], shaft(bench, joint), 1000)
        first = int(found.argmax())
        assert first > 0 and found[first:].all()
        worst.see(abs(wanted[first] / 5.4 - 1.0), f"{joint}, r = {wanted[first]:.3g}")
    worst.below(0.1)
    told = margins(compiled(text, "bench"), [0, len(heavier) - 1])
    assert [one.stable for case in told for one in case] == [True, True, False, False]
    # each joint by itself would not grow: the elbow is far from its limit
    assert all(one.limit is not None and case[1].r < 0.3 * one.limit for case in told for one in case)


@pytest.mark.slow
def test_a_servo_with_much_gain_grows_below_one_r_and_above_another_as_the_margin_says() -> None:
    heaviness = (0.05, 0.1, 0.17, 0.2, 0.5, 1.5, 3.0, 3.8, 4.3, 6.0)
    masses = ", ".join(f"{r * ROTOR * 3.0 / REACH**2:.12g}" for r in heaviness)
    text = deck(
        law="measured_acceleration",
        duration=4.0,
        arm=ONE,
        sweep=f"vary load = [{masses}] kg;",
        servo={"shoulder": "told { kp = 1 V*s/rad; }"},
    )
    found = grows(ran(text, "own").signals["qd"][:, :, 0], shaft(ran(text, "bench"), "shoulder"), 500)
    told = [one for (one,) in margins(compiled(text, "bench"))]
    assert found.tolist() == [not one.stable for one in told] == [True] * 3 + [False] * 5 + [True] * 2
    assert all(one.lower == pytest.approx(0.1815, rel=0.01) for one in told)
    assert all(one.limit == pytest.approx(4.01, rel=0.01) for one in told)


@pytest.mark.release
def test_joints_together_grow_where_the_least_r_of_all_their_motions_is_too_small() -> None:
    """Each joint by itself would not: the lighter of the two is at twice the r that its servo needs.

    A ramp, since after a step that takes the drives to their limits they ring on at these gains.
    """
    text = """
        let ratio = 40;
        servo stiff {
            model = rigid_gearbox;  ratio = ratio;  kp = 0.16 V*s/rad;  ki = 1.2 V/rad;  v_max = 24 V;
            resistance = 0.6 ohm;  kt = 0.036 N*m/A;  tau_max = 0.4 N*m;  j_m = 1.2e-5 kg*m^2;  f_c = 0 N*m;
            f_v = 3e-6 N*m*s/rad;  command = rate(ramp(to = 60 rad/s / ratio, over = 3 s));
        }
        arm desk {
            link upper { mass = 2.5 kg;  shape = rod(length = 0.6 m, along = x); }
            link fore  { mass = 1.2 kg;  shape = rod(length = 0.45 m, along = x); }
            joint hip  revolute { parent = base;   child = upper;  axis = z; }
            joint knee revolute { parent = upper;  child = fore;   axis = z;  at = [0.6, 0, 0] m; }
        }
        run bench {
            arm      = desk;
            servos   { hip = stiff;  knee = stiff; }
            rates    { dynamics = 500 Hz;  servos = 500 Hz;  record = 500 Hz; }
            duration = 6 s;
            record   = [hip.servo.voltage, knee.servo.voltage];
            substitute hip  { bed = emulated(delay = 1);  law = torque_balance_observer; }
            substitute knee { bed = emulated(delay = 1);  law = torque_balance_observer; }
        }
        sweep ratios of bench { vary ratio = [60, 40, 30, 25]; }
    """
    signals = ran(text, "ratios").signals
    told = margins(compiled(text, "ratios"))
    for number, joint in enumerate(("hip", "knee")):
        voltage = signals[f"{joint}.servo.voltage"].reshape(4, -1)[:, -500:]
        rings = np.mean(np.abs(np.diff(voltage, 2, axis=1)), axis=1) > 1e-2  # V
        stable = [case[number].stable for case in told]
        assert rings.tolist() == [not each for each in stable] == [True, True, False, False]
    assert all(one.r > 1.5 * one.lower and one.too_light for one in told[1])


@pytest.mark.slow
def test_the_margin_tells_the_r_of_the_arm_at_the_start() -> None:
    text = deck(sweep=loads([0.5, 5.0]), duration=0.5)
    told = [each[0].r for each in margins(compiled(text, "bench"))]
    worst = Worst("r as `met margin` tells it, against J_eff of the run, as a share")
    for ours, theirs in zip(told, r_of(ran(text, "own"), 0), strict=True):
        worst.see(abs(ours / theirs - 1.0), f"r = {theirs:.3g}")
    worst.below(1e-9)
