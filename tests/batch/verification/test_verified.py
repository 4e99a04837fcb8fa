"""Cases that are run again with shorter steps: which, what is kept of them, and what follows about the numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns import tasks
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.verification import verifying
from batch.campaigns.verification.verifying import chosen, most
from batch.queries.step_errors.figures import case_error, figures
from met import cli
from met import run as engine
from met.analysis.step_error import refine
from met.diagnostic import Problem
from met.plan import Plan
from tests.batch import begun, plans

SWEEP = """#include <two_link.ic>
run brief like nominal { duration = 2 s; metric turn = final { of = elbow.q; } }
sweep gain of brief { vary gearbox.kp = linspace(0.010, 0.040, 6) V*s/rad; }
"""


@pytest.fixture(scope="module")
def sweep() -> Plan:
    return ic.compile(text=SWEEP, select=["gain"])


def datasets(path: Path) -> dict[str, bytes]:
    """The bytes of every dataset but those of the verification."""
    found = {}

    def take(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset) and not name.startswith("verification/"):
            found[name] = node.asstr()[...].tobytes() if node.dtype.kind == "O" else node[...].tobytes()
            if node.dtype.kind == "O":
                found[name] = "\0".join(map(str, np.atleast_1d(node.asstr()[...]).ravel())).encode()

    with h5py.File(path) as file:
        file.visititems(take)
    return found


def outcomes(status: list[int], **metrics: list[float]) -> CaseOutcomes:
    found = CaseOutcomes(plans.gains(len(status)))
    found.add(np.array(status), {name: np.array(values) for name, values in metrics.items()})
    return found


# Which


def test_the_first_the_last_the_worst_and_some_by_the_seed_are_chosen_of_those_that_reached_their_end() -> None:
    status = [1, *[0] * 97, 1, 0]
    settle = [math.nan, *np.linspace(1.0, 2.0, 97), math.nan, math.inf]
    volts = [math.nan, *np.cos(np.linspace(0.0, 9.0, 97)), math.nan, 0.0]
    of = plans.gains(100)
    found = chosen(of, outcomes(status, settle=settle, volts=volts)).tolist()
    assert found == sorted(set(found)) and len(found) <= most(2, 100)
    assert {1, 97, 99, int(np.nanargmax(volts))} <= set(found)  # what never settles has no error: the next is worst
    assert found == chosen(of, outcomes(status, settle=settle, volts=volts)).tolist()
    assert chosen(of, outcomes([1] * 4, settle=[1.0] * 4)).tolist() == []
    assert chosen(of, outcomes([0], settle=[1.0])).tolist() == [0]


# What is kept


@pytest.mark.slow
def test_what_is_kept_is_what_the_refined_experiments_give(sweep: Plan, tmp_path: Path) -> None:
    archive = batch.run(sweep, output=tmp_path / "a.h5", verify="all")
    [of] = sweep.experiments
    with ArchiveFile(archive.path) as file:
        found = file.groups[0].verified
    assert found is not None and found.cases.tolist() == list(range(6))
    assert (found.order, found.step) == (2, 0.04)
    assert found.metrics == ("settle", "volts", "turn")
    assert found.instant.tolist() == [0.01, 0.0, 0.0]
    for factor, values in ((2, found.half), (4, found.quarter)):
        metrics = engine.run(refine(of, factor)).metrics
        for column, name in enumerate(found.metrics):
            np.testing.assert_allclose(values[:, column], metrics[name], rtol=1e-13)


@pytest.mark.slow
def test_the_campaign_has_the_same_bytes_with_and_without(sweep: Plan, tmp_path: Path) -> None:
    bare = batch.run(sweep, output=tmp_path / "a.h5", verify="none").path
    verified = batch.run(sweep, output=tmp_path / "b.h5", verify="some").path
    assert datasets(bare) == datasets(verified)
    again = batch.run(sweep, output=tmp_path / "c.h5", verify="some", threads=1).path
    assert verified.read_bytes() == again.read_bytes()
    with ArchiveFile(bare) as file:
        assert file.groups[0].verified is None and figures(file.groups[0]) is None


@pytest.mark.slow
def test_a_campaign_that_was_interrupted_or_run_in_processes_is_verified_alike(
    sweep: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = batch.run(sweep, output=tmp_path / "a.h5", verify="some").path.read_bytes()
    assert batch.run(sweep, output=tmp_path / "b.h5", verify="some", processes=2).path.read_bytes() == wanted
    begun.short_tasks(monkeypatch)
    monkeypatch.setattr(tasks, "MOST_CASES", 2)
    (tmp_path / "alone").mkdir()
    resumed = tmp_path / "alone" / "c.h5"
    begun.begin(resumed, sweep, after=1, verify="some")
    begun.go_on(resumed, sweep, verify="some")
    assert resumed.read_bytes() == wanted


@pytest.mark.slow
def test_the_command_has_three_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.ic").write_text(SWEEP)
    for word, cases in (("none", None), ("some", 4), ("all", 6)):
        asked = ["run", "d.ic", "gain", "--verify", word, "-q", "--no-picture", "-o", f"{word}.h5"]
        assert cli.main(asked) == cli.NO  # five of the cases never settle
        with ArchiveFile(tmp_path / f"{word}.h5") as file:
            found = file.groups[0].verified
        assert (None if found is None else len(found.cases)) == cases
    assert cli.main([*asked[:3], "--verify", "much"]) == cli.BAD_INPUT
    with pytest.raises(ValueError, match="verify is one of auto, none, some, all, and not 'much'"):
        batch.run(ic.compile("d.ic", select=["gain"]), verify="much")  # type: ignore[arg-type]


@pytest.mark.slow
def test_an_archive_is_whole_for_whoever_asks_for_the_same(sweep: Plan, tmp_path: Path) -> None:
    def written() -> int:
        return (tmp_path / "a.h5").stat().st_mtime_ns

    batch.run(sweep, output=tmp_path / "a.h5")
    first = written()
    batch.run(sweep, output=tmp_path / "a.h5", verify="none")  # which six cases have by themselves
    assert written() == first
    batch.run(sweep, output=tmp_path / "a.h5", verify="some")
    assert written() != first


@pytest.mark.slow
def test_what_is_damaged_is_told(sweep: Plan, tmp_path: Path) -> None:
    archive = batch.run(sweep, output=tmp_path / "a.h5", verify="some").path

    def other_cases(node: h5py.Group) -> None:
        node["verified_case"][0] = 77

    def other_metric(node: h5py.Group) -> None:
        node["verified_metric"][0] = "nothing"

    def gone(node: h5py.Group) -> None:
        del node["half"]

    def short(node: h5py.Group) -> None:
        del node["half"]
        node["half"] = np.zeros((1, 3))

    def negative(node: h5py.Group) -> None:
        node["instant"][0] = -1.0

    def below(node: h5py.Group) -> None:
        node["missed"][0, 0] = -1.0

    def no_order(node: h5py.Group) -> None:
        node.attrs["order"] = 0

    def no_step(node: h5py.Group) -> None:
        node.attrs["step_s"] = "long"

    changes: dict[Callable[[h5py.Group], None], str] = {
        other_cases: "its verified cases are none of its cases",
        other_metric: "its verified metrics are none of its metrics",
        gone: "variable `verification/half` is missing or of another type",
        short: "variable `verification/half` is not of the size of its dimensions",
        negative: "variable `verification/instant` has a value that it cannot have",
        below: "variable `verification/missed` has a value that it cannot have",
        no_order: "attribute `order` of `verification` is missing or of another type",
        no_step: "attribute `step_s` of `verification` is missing or of another type",
    }
    for change, why in changes.items():
        copy = tmp_path / "b.h5"
        copy.write_bytes(archive.read_bytes())
        with h5py.File(copy, "r+") as file:
            change(file["verification"])
        with pytest.raises(Problem, match="E302") as caught, ArchiveFile(copy):
            pass
        assert caught.value.diagnostics[0].message == f"the archive {copy} is damaged: {why}"


@pytest.mark.slow
def test_a_metric_that_an_older_archive_calls_verification_is_none(sweep: Plan, tmp_path: Path) -> None:
    archive = batch.run(sweep, output=tmp_path / "a.h5", verify="none").path
    with h5py.File(archive, "r+") as file:
        file.move("turn", "verification")
    with ArchiveFile(archive) as file:
        assert file.groups[0].verified is None


@pytest.mark.slow
def test_an_older_archive_says_nothing_of_what_lies_between_samples(sweep: Plan, tmp_path: Path) -> None:
    archive = batch.run(sweep, output=tmp_path / "a.h5", verify="some").path
    with ArchiveFile(archive) as file:
        assert file.groups[0].verified is not None
        errors = {name: each.error for name, each in figures(file.groups[0]).metrics.items()}
    with h5py.File(archive, "r+") as file:
        del file["verification/missed"]
    with ArchiveFile(archive) as file:
        assert {name: each.error for name, each in figures(file.groups[0]).metrics.items()} == errors, "none is missed"


# What follows


STOPPED = """
arm a {
    link l { mass = 5.2062 kg;  shape = rod(length = 0.5342 m, along = x); }
    joint j revolute { parent = base;  child = l;  axis = -y; }
}
servo s {
    model = rigid_gearbox;  ratio = 63.27;  kp = 0.0777 V*s/rad;  ki = 0.375 V/rad;  v_max = 60 V;
    resistance = 1.2 ohm;  kt = 0.08 N*m/A;  tau_max = 8 N*m;  j_m = 2.113e-4 kg*m^2;  f_c = 0.0082 N*m;
    command = rate(0.479 rad/s);
}
run r {
    arm = a;  servos { j = s; }
    environment {
        g  = gravity { g = [0, 0, -9.81] m/s^2; }
        st = joint_stop {
            joint = j;  upper = 0.422 rad;  lower = -0.397 rad;  stiffness = 8237 N*m/rad;  dissipation = 0.82 s/rad;
        }
    }
    rates { dynamics = 2000 Hz;  servos = 500 Hz;  record = 125 Hz; }
    duration = 2 s;
    record = [q];
    metric fastest = peak { of = j.qd; }
    metric slow = always { of = abs(j.qd) < 2 rad/s;  after = 0.2 s; }
    metric volts = max { of = j.servo.voltage; }
}
"""


@pytest.mark.slow
def test_a_peak_at_a_stop_that_is_the_same_sample_at_all_three_steps_is_not_said_to_be_exact(tmp_path: Path) -> None:
    """The three runs see the same sample, and so their differences show the error of integration alone."""
    (tmp_path / "d.ic").write_text(STOPPED)
    plan = ic.compile(str(tmp_path / "d.ic"))
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", verify="some").path) as file:
        verified, found = file.groups[0].verified, figures(file.groups[0])
    assert verified is not None and found is not None
    truth = engine.run(refine(plan.experiments[0], 64)).metrics
    for name in ("fastest", "slow"):
        [each] = found.metrics[name].cases
        assert each.error is not None
        true = abs(each.value - truth[name][0])
        assert abs(each.value - each.half) + abs(each.half - each.quarter) < 0.1 * true < true
        assert true <= each.error.error < 5.0 * true
    assert verified.missed[0, verified.metrics.index("volts")] == 0.0, "seen at the servo's ticks, at all three steps"


def test_errors_follow_from_three_values() -> None:
    error = case_error(3, (1.0 + 16e-6, 1.0 + 4e-6, 1.0 + 1e-6), 2, 0.0).error
    assert error is not None and error.clear
    assert error.error == pytest.approx(16e-6, rel=1e-6) and error.order == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ((math.inf, math.inf, math.inf), "infinite at every step"),
        ((1.0, math.inf, 1.0), "infinite at half the step, and not at another"),
        ((math.inf, 1.0, 1.0), "infinite at the step, and not at another"),
        ((math.inf, -math.inf, math.inf), "infinite at the step, and not at another"),
        ((1.0, 1.0, math.nan), "no value at a quarter of the step"),
        ((math.nan, math.nan, math.nan), "no value at the step"),
    ],
)
def test_what_is_not_finite_has_no_error(values: tuple[float, float, float], why: str) -> None:
    found = case_error(0, values, 2, 0.0)
    assert found.error is None and found.why == why


@pytest.mark.slow
def test_the_figure_of_a_campaign_is_that_of_its_worst_case(sweep: Plan, tmp_path: Path) -> None:
    archive = batch.run(sweep, output=tmp_path / "a.h5", verify="all").path
    with ArchiveFile(archive) as file:
        [group] = file.groups
        found = figures(group)
        alone = [figures(group, position) for position in range(6)]
    assert found is not None
    errors = [each.metrics["turn"].error for each in alone if each is not None]
    assert len(errors) == 6 and found.cases == 6
    assert found.metrics["turn"].error == max(errors) > 0.0
    assert found.metrics["turn"].case == int(np.argmax(errors))
    unsettled = [n for n, each in enumerate(alone) if each is not None and math.isnan(each.metrics["settle"].error)]
    assert found.metrics["settle"].unknown == len(unsettled)


# When


def test_it_is_done_by_itself_where_it_is_cheap() -> None:
    def said(cases: int, ticks: int) -> str:
        return verifying.resolve("auto", engine.prepare(plans.gains(cases, ticks=ticks)), cases)

    assert said(10, 2000) == "none"  # 6 cases of 10 would be 36 more
    assert said(1_300, 2000) == "none"  # and two programs
    assert said(10_000, 2000) == "none"
    assert said(40_000, 2000) == "some"
    assert said(1_300, 2_000_000) == "some"
    nominal = engine.prepare(plans.nominal(ticks=2000))
    assert verifying.resolve("auto", nominal, 1) == "some"
    assert verifying.resolve("auto", engine.prepare(plans.nominal(ticks=400_000)), 1) == "none"
    assert verifying.resolve("none", nominal, 1) == "none"
    assert verifying.resolve("all", engine.prepare(plans.gains(10)), 10) == "all"
