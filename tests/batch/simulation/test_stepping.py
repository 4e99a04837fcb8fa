"""`Simulation.start` and `step`: a case stepped by commands from outside is the run that has these commands."""

from __future__ import annotations

import gc
import os
from typing import Any

import numpy as np
import pytest
import xarray

import batch
from met.diagnostic import Problem
from tests.batch.simulation.arms import ARM, NOISY
from tests.batch.simulation.test_run import Measured, resident

BOTH = ("shoulder", "elbow")

TABLES = """\
#include <two_link.ic>

servo to_and_fro like gearbox {
    command = rate(table(times = [0, 0.3999, 0.4, 0.8399, 0.84, 2] s, values = [10, 10, -30, -30, 5, 5] mrad/s));
}
run swing like nominal {
    duration = 2 s;
    servos { shoulder = to_and_fro;  elbow = gearbox; }
    rates { servos = 50 Hz; }
    allow D105 because "the rates are the paper's own";
}
run pushed like swing {
    servos { shoulder = pusher;  elbow = gearbox; }
}
servo pusher like gearbox { command = torque(100 N*m); }
servo analog like gearbox { rate = continuous; }
run smooth like swing { servos { shoulder = analog;  elbow = gearbox; } }
"""


@pytest.fixture(scope="module")
def arm() -> batch.Simulation:
    return batch.Simulation(text=ARM, run="reach")


class TestSameAsARun:
    @pytest.mark.slow
    def test_steady_commands_give_the_bits_of_a_run_with_them_as_inputs(self, arm: batch.Simulation) -> None:
        state = arm.start({"load": "25 kg"}, commands=BOTH)
        seen = [state.seen]
        while not state.done:
            seen.append(state.step([0.03, -0.01]))
        values = {"load": 25, "shoulder.servo.command.value": 0.03, "elbow.servo.command.value": -0.01}
        data = arm.run(values, histories=True)
        assert [each.time for each in seen] == data.time.values.tolist()
        for name in ("q", "qd", "tau", "shoulder.servo.voltage"):
            found, wanted = np.array([each[name] for each in seen]), data[name].values[0]
            np.testing.assert_array_equal(found[1:], wanted[1:])
        np.testing.assert_array_equal(seen[0].q, data.q.values[0, 0])
        assert state.metrics == {name: data[name].item() for name in ("settle", "volts")}

    @pytest.mark.release
    @pytest.mark.parametrize(
        ("deck", "run"),
        [
            ("ets_vii.ic", None),
            ("puma_560.ic", None),
            ("station_arm.ic", None),
            ("free_flyer.ic", None),
            ("two_link.ic", "hybrid"),
        ],
    )
    def test_any_deck_with_guides_sensors_beds_and_bases_of_any_kind(self, deck: str, run: str | None) -> None:
        servos = batch.Simulation(deck, run=run).experiment.structure.servos
        kinds = {use.joint: use.command.kind for use in servos if use.command is not None}
        texts = {"position": "position(0.1 rad)", "rate": "rate(0.02 rad/s)"}
        sim = batch.Simulation(deck, run=run, set={f"{joint}.servo.command": texts[kinds[joint]] for joint in kinds})
        values = {joint: 0.02 if kind == "rate" else 0.1 for joint, kind in kinds.items()}
        state = sim.start(commands=list(kinds), record=[])
        data = sim.run({f"{joint}.servo.command.value": value for joint, value in values.items()}, histories="q")
        rows = {round(time, 9): row for row, time in enumerate(data.time.values.tolist())}
        compared = 0
        while not state.done and compared < 40:
            seen = state.step(list(values.values()))
            if (row := rows.get(round(seen.time, 9))) is not None:
                np.testing.assert_array_equal(seen.q, data.q.values[0, row])
                compared += 1
        assert compared == 40 and not state.failed

    @pytest.mark.slow
    def test_commands_that_change_give_the_bits_of_a_table(self) -> None:
        sim = batch.Simulation(text=TABLES, run="swing")
        state = sim.start(commands="shoulder")
        seen = [state.seen]
        while not state.done:
            time = round(state.seen.time, 9)
            seen.append(state.step(0.01 if time < 0.4 else -0.03 if time < 0.84 else 0.005))
        data = sim.run(histories=True)
        for name in ("q", "qd"):
            np.testing.assert_array_equal([each[name] for each in seen], data[name].values[0])
        assert np.ptp(data.qd.values[0, :, 0]) > 0.01

    @pytest.mark.slow
    def test_a_command_may_be_of_another_kind_than_the_decks(self) -> None:
        state = batch.Simulation(text=TABLES, run="swing").start(commands={"shoulder": "torque"})
        while not state.done:
            state.step([100.0])
        data = batch.Simulation(text=TABLES, run="pushed").run(histories=True)
        np.testing.assert_allclose(state.seen.q, data.q.values[0, -1], rtol=1e-12)
        assert abs(state.seen.q[0]) > 1e-3

    @pytest.mark.slow
    def test_noise_and_what_sensors_read_are_those_of_the_repeat(self) -> None:
        sim = batch.Simulation(text=NOISY, run="noisy")
        data = sim.run({"shoulder.servo.command.value": 0.03}, repeat=3, histories=True)
        for repeat in (1, 2):
            state = sim.start(commands="shoulder", repeat=repeat, record=["shoulder.servo.sensor.qd"])
            read = []
            while not state.done:
                seen = state.step(0.03)
                read.append(seen["shoulder.servo.sensor.qd"] - seen.qd[0])
            np.testing.assert_array_equal(state.seen.q, data.q.values[repeat, -1])
            assert 0.0005 < np.std(read) < 0.002

    def test_what_is_seen_stays_as_it_was(self, arm: batch.Simulation) -> None:
        state = arm.start(commands=BOTH)
        first = state.step([0.1, 0.1])
        was = first.q.copy()
        state.step([0.1, 0.1])
        np.testing.assert_array_equal(first.q, was)
        assert first.keys() == ("q", "qd", "tau", "shoulder.servo.voltage") and repr(first).startswith(
            "Observation at 0.04 s"
        )


class TestBeginningsAndEnds:
    def test_cases_do_not_know_of_each_other(self, arm: batch.Simulation) -> None:
        one, other = (arm.start({"load": load}, commands=BOTH) for load in (5, 25))
        for _ in range(10):
            one.step([0.05, 0.0])
            other.step([-0.05, 0.0])
        again = arm.start({"load": 5}, commands=BOTH)
        for _ in range(10):
            again.step([0.05, 0.0])
        np.testing.assert_array_equal(one.seen.row, again.seen.row)
        assert one.seen.q[0] > 0.0 > other.seen.q[0]

    @pytest.mark.slow
    def test_a_case_that_fails_is_done_and_says_why(self, arm: batch.Simulation) -> None:
        state = arm.start({"initial.elbow.qd": 1e200}, commands=BOTH)
        while not state.done:
            state.step([0.0, 0.0])
        wanted = arm.run({"initial.elbow.qd": 1e200}).cause.item()
        assert state.failed and state.cause == wanted
        with pytest.raises(Problem) as caught:
            state.step([0.0, 0.0])
        assert str(caught.value).startswith(f"E437: the case has failed: {wanted}")

    def test_after_the_end_nothing_is_stepped(self, arm: batch.Simulation) -> None:
        state = arm.start(commands=BOTH)
        while not state.done:
            state.step([0.0, 0.0])
        assert not state.failed and state.cause == "" and state.seen.time == 2.0
        with pytest.raises(Problem) as caught:
            state.step([0.0, 0.0])
        (found,) = caught.value.diagnostics
        assert (found.code, found.message) == ("E437", "the run ends at 2 s")

    @pytest.mark.parametrize(
        "commands",
        [
            [0.1],
            [0.1, 0.2, 0.3],
            [0.1, float("nan")],
            0.1,
            np.float32(1),
            np.array([np.inf, 0.0]),
            "ab",
            ["0", "1"],
            None,
            [10**400, 1],
            np.ma.array([1.0, 2.0], mask=[False, True]),
            np.array([1j, 0.0]),
            [True, False],
            {0.1: 1, 0.2: 2},
            {0.1, 0.2},
            b"ab",
            [[0.1], [0.2]],
            Measured([0.1, 0.2], "deg/s"),
            xarray.DataArray([0.1, 0.2], attrs={"units": "deg/s"}),
        ],
    )
    def test_commands_are_one_finite_number_each(self, arm: batch.Simulation, commands: object) -> None:
        state = arm.start(commands=BOTH)
        with pytest.raises(Problem) as caught:
            state.step(commands)
        (found,) = caught.value.diagnostics
        assert found.code == "E436"
        assert found.message.startswith("commands are a finite number for each of shoulder, elbow, and not ")
        assert found.help == ("in SI, in this order: `state.step([0.1, 0.2])`",)
        assert state.seen.time == 0.0

    def test_the_example_has_as_many_commands_as_joints(self, arm: batch.Simulation) -> None:
        with pytest.raises(Problem) as caught:
            arm.start(commands="elbow").step([0.1, 0.2])
        assert caught.value.diagnostics[0].help == ("in SI: `state.step([0.1])`",)

    @pytest.mark.release
    def test_a_thousand_cases_leak_nothing(self, arm: batch.Simulation) -> None:
        def cases(count: int) -> None:
            for number in range(count):
                state = arm.start({"load": number % 9}, commands=BOTH)
                state.step([0.0, 0.0])
            gc.collect()

        cases(100)
        files, memory = len(os.listdir("/proc/self/fd")), resident()
        cases(1000)
        assert len(os.listdir("/proc/self/fd")) == files
        assert resident() - memory < 2 << 20  # the block of a case has 3 kB


CONTINUOUS = "is continuous: it has no tick at which it takes a command"
TWO = "and these values make 2"
SAME = "so a repeat is the same case again"
NEGATIVE = "link `upper` must be at least 0 kg; case #0 breaks it"


class TestWhatIsRefused:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("run", "asked", "code", "said"),
        [
            ("swing", {"commands": "shouldr"}, "E435", "no servo moves a joint `shouldr`"),
            ("swing", {"commands": []}, "E435", "no joint is commanded from outside"),
            ("swing", {"commands": {"elbow": "speed"}}, "E435", "joint `elbow` has no command `speed`"),
            ("smooth", {"commands": "shoulder"}, "E435", f"the law of joint `shoulder` {CONTINUOUS}"),
            ("swing", {"commands": "elbow", "record": ["elbow.qdd_"]}, "E432", "no channel `elbow.qdd_` in this run"),
            ("swing", {"commands": "elbow", "values": {"reach": [1, 2]}}, "E430", f"one case is stepped, {TWO}"),
            ("swing", {"commands": "elbow", "repeat": 1}, "D230", f"there is no noise in this run, {SAME}"),
            ("swing", {"commands": "elbow", "values": {"links.upper.mass": -1}}, "D077", f"`mass` of {NEGATIVE}"),
        ],
    )
    def test_at_the_start(self, run: str, asked: dict[str, object], code: str, said: str) -> None:
        sim = batch.Simulation(text=TABLES, run=run)
        for _ in range(2):
            with pytest.raises(Problem) as caught:
                sim.start(**asked)  # type: ignore[arg-type]
            found = caught.value.diagnostics[0]
            assert (found.code, found.message) == (code, said)

    def test_a_command_that_a_model_does_not_take_is_told_once(self) -> None:
        with pytest.raises(Problem) as caught:
            batch.Simulation(text=TABLES, run="swing").start(commands={"elbow": "acceleration"})
        (found,) = caught.value.diagnostics
        assert found.code == "D152" and found.message.endswith("takes no command `acceleration`")

    @pytest.mark.slow
    @pytest.mark.parametrize("kinds", [["shoulder"], {"shoulder": "torque"}])
    def test_a_given_command_of_a_joint_that_is_commanded_from_outside(self, arm: batch.Simulation, kinds: Any) -> None:
        with pytest.raises(Problem) as caught:
            arm.start({"shoulder.servo.command.value": 0.3}, commands=kinds)
        assert str(caught.value) == (
            "E435: `shoulder.servo.command.value` is given, and joint `shoulder` is commanded from outside\n"
            "  leave `shoulder.servo.command.value` out, and tell `step` its command\n"
            "  or leave `shoulder` out of `commands`"
        )
        arm.start({"elbow.servo.command.value": 0.3}, commands="shoulder").step(0.1)

    @pytest.mark.parametrize(
        ("asked", "code", "said"),
        [
            ({"commands": ["shoulder", "shoulder"]}, "E435", "`commands` has joint `shoulder` twice"),
            *(
                ({"commands": given}, "E435", f"`commands` is one text or a list of texts, and not {shown}")
                for given, shown in [
                    (None, "None"),
                    (5, "5"),
                    ([1], "[1]"),
                    ({"shoulder"}, "{'shoulder'}"),
                    ({1: "rate"}, "[1]"),
                    ({"shoulder": 5}, "[5]"),
                ]
            ),
            *(
                ({"record": given}, "E432", f"`record` is one text or a list of texts, and not {given!r}")
                for given in (5, [None], b"q")
            ),
            *(
                ({"repeat": given}, "E431", f"`repeat` is a whole number, at least 0 and below 2^32, and not {given!r}")
                for given in ("a", -1, float("nan"), True, 1.0, 2**32)
            ),
        ],
    )
    def test_arguments_of_another_type_or_range(
        self, arm: batch.Simulation, asked: dict[str, Any], code: str, said: str
    ) -> None:
        with pytest.raises(Problem) as caught:
            arm.start(**{"commands": "elbow", **asked})
        (found,) = caught.value.diagnostics
        assert (found.code, found.message) == (code, said)

    def test_a_continuous_law_takes_commands_once_it_has_a_rate(self) -> None:
        sim = batch.Simulation(text=TABLES, run="smooth", set={"shoulder.servo.rate": "100 Hz"})
        assert sim.start(commands="shoulder").step(0.01).time == 0.04

    def test_what_is_not_seen(self, arm: batch.Simulation) -> None:
        with pytest.raises(Problem) as caught:
            arm.start(commands="elbow").seen["qddd"]
        assert str(caught.value).startswith("E432: no `qddd` is seen\n  did you mean `qd`?\n  seen are: q, qd, tau")
