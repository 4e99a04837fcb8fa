"""Sweeps of several structures, repeats and seeds, from the deck to the archive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

import batch
import ic
from batch.archive.read import ArchiveFile
from met import run as engine
from met.cli import main
from met.plan import Experiment, Plan
from tests.ic.small_decks import ARM, RUN, SERVO, changed

TIMED = changed(
    RUN, ("record = [q];", "record = [q, qd];\n    metric end = final { of = hinge.q; }\n    require end > 150 mrad;")
)
NOISY = changed(
    TIMED, ("duration", "substitute hinge { bed = emulated(faults = typical); law = torque_balance; }\n    duration")
)
BRISK = "servo brisk like drive { kp = 0.3 V*s/rad; command = rate(0.2 rad/s); }\n"


def compiled(folder: Path, *parts: str, select: str = "it") -> Plan:
    path = folder / "deck.ic"
    path.write_text("".join((ARM, SERVO, BRISK, *parts)), encoding="utf-8")
    return ic.compile(path, select=[select])


def ran(folder: Path, plan: Plan, **options: object) -> Path:
    batch.run(plan, output=folder / "it.h5", **options)  # type: ignore[arg-type]
    return folder / "it.h5"


def noise_of(plan: Plan) -> np.ndarray:
    """Last position of every case, which noise has moved a little."""
    (experiment,) = plan.experiments
    return engine.run(experiment).signals["q"][:, -1, 0]


STRUCTURES = "sweep it of hold { vary links.bar.mass = [1, 2, 3] kg; vary hinge.servo = [drive, brisk]; }\n"


@pytest.mark.slow
def test_an_archive_has_a_group_for_each_structure(tmp_path: Path) -> None:
    path = ran(tmp_path, compiled(tmp_path, TIMED, STRUCTURES))
    tree = xarray.open_datatree(path, engine="h5netcdf")
    drive, brisk = tree["it.drive"].to_dataset(), tree["it.brisk"].to_dataset()
    assert drive["case"].values.tolist() == [0, 2, 4]
    assert brisk["case"].values.tolist() == [1, 3, 5]
    assert brisk["hinge.servo"].values.tolist() == ["brisk"] * 3
    assert brisk["links.bar.mass"].values.tolist() == [1.0, 2.0, 3.0]
    assert "hinge.servo" in brisk["end"].coords
    assert (brisk.attrs["sweep"], brisk.attrs["experiment"]) == ("it", "it.brisk")
    assert brisk["recorded_case"].values.tolist() == [1, 3, 5]
    assert np.all(brisk["end"] > 1.5 * drive["end"].values)


def test_a_group_is_the_run_that_one_would_write(tmp_path: Path) -> None:
    by_hand = (
        "run other like hold { servos { hinge = brisk; } } sweep alone of other { vary links.bar.mass = [1, 2, 3] kg; }"
    )
    plan = compiled(tmp_path, TIMED, STRUCTURES)
    other = compiled(tmp_path, TIMED, by_hand, select="alone")
    brisk = next(each for each in plan.experiments if each.name == "it.brisk")
    assert np.array_equal(engine.run(brisk).signals["q"], engine.run(other.experiments[0]).signals["q"])


@pytest.mark.slow
def test_a_position_names_one_case_of_all_groups(tmp_path: Path) -> None:
    plan = compiled(tmp_path, TIMED, STRUCTURES)
    whole = xarray.open_datatree(ran(tmp_path, plan), engine="h5netcdf")["it.brisk"].to_dataset().load()
    batch.run(plan, output=tmp_path / "one.h5", cases=["#3"])
    one = xarray.open_dataset(tmp_path / "one.h5", engine="h5netcdf")
    assert one["case"].values.tolist() == [3]
    assert one["case_id"].values[0] == whole["case_id"].values[1]
    assert np.array_equal(one["q"].values[0], whole["q"].values[1])


@pytest.mark.slow
def test_show_finds_a_case_by_its_position_and_a_sweep_by_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ran(tmp_path, compiled(tmp_path, TIMED, STRUCTURES))

    def shown(*words: str) -> str:
        assert main(["show", str(path), *words]) == 0
        return capsys.readouterr().out

    assert "hinge.servo = brisk" in shown("--case", "#3")
    assert "case #3" in shown("--case", "#3")
    assert shown("--run", "it").count("3 cases,") == 2
    assert "it.drive" not in shown("--run", "it.brisk")


@pytest.mark.slow
def test_the_verdict_sums_up_the_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    compiled(tmp_path, TIMED, STRUCTURES)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "deck.ic", "it", "--no-picture"]) == 1
    told = capsys.readouterr().out
    assert (
        """\
it: 6 of 6 cases reached their end, of 2 structures
  require end > 150 mrad  met by 3 of 6 (50 %)

                        cases  meet all    end
  median of the cases:                    mrad
  it.drive                  3         0  95.05
  it.brisk                  3         3  190.5
"""
        in told
    )


@pytest.mark.slow
def test_of_many_structures_the_table_alone_is_told_and_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    many = "sweep it of hold { vary duration = (1 .. 6 by 1) s; vary drive.kp = [0.1, 0.2] V*s/rad; }\n"
    compiled(tmp_path, TIMED, many)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "deck.ic", "it", "--no-picture"]) == 1
    told = capsys.readouterr().out
    assert "it: 12 of 12 cases reached their end, of 6 structures" in told
    assert "worst" not in told
    assert main(["show", "deck.it.h5"]) == 0
    told = capsys.readouterr().out
    assert "one structure in full: `met show deck.it.h5 --run it.1_s`; the cases of all: `--all-cases`" in told
    assert len(told.splitlines()) < 20
    assert main(["show", "deck.it.h5", "--run", "it.3_s"]) == 0
    assert "duration = 3 s" in capsys.readouterr().out


def test_cases_lists_the_table_of_all_groups_in_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    compiled(tmp_path, TIMED, STRUCTURES)
    assert main(["cases", str(tmp_path / "deck.ic")]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[:4] == [
        "it: 6 cases, 2 structures",
        "  group     hinge.servo  cases   a case",
        "  it.drive  drive            3  1.6 KiB",
        "  it.brisk  brisk            3  1.6 KiB",
    ]
    assert [line.split()[0] for line in told[7:]] == [f"#{n}" for n in range(6)]
    assert [line.split()[2] for line in told[7:]] == ["drive", "brisk"] * 3


@pytest.mark.slow
def test_repeats_feel_noise_of_their_own_and_the_first_is_that_of_the_run_alone(tmp_path: Path) -> None:
    alone = noise_of(compiled(tmp_path, NOISY, select="hold"))
    repeated = noise_of(compiled(tmp_path, NOISY, "sweep it of hold { repeat 4; }"))
    assert len(set(repeated.tolist())) == 4
    assert repeated[0] == alone[0]


@pytest.mark.slow
def test_cases_feel_the_same_noise_unless_seeds_are_independent(tmp_path: Path) -> None:
    """The gear ratio of an unused direction: cases whose motion differs by nothing but noise."""
    body = "sweep it of hold { %s vary initial.hinge.q = [0, 0.5] rad; }"
    common = noise_of(compiled(tmp_path, NOISY, body % "")) - np.array([0.0, 0.5])
    apart = noise_of(compiled(tmp_path, NOISY, body % "seeds = independent;")) - np.array([0.0, 0.5])
    assert abs(common[1] - common[0]) < 1e-12
    assert abs(apart[1] - apart[0]) > 1e-9


@pytest.mark.slow
def test_more_values_products_and_repeats_change_no_old_case(tmp_path: Path) -> None:
    def by_name(body: str) -> dict[str, bytes]:
        plan = compiled(tmp_path, NOISY, f"sweep it of hold {{ {body} }}")
        dataset = xarray.open_dataset(ran(tmp_path, plan), engine="h5netcdf").load()
        return {
            str(key): row.tobytes() for key, row in zip(dataset["case_id"].values, dataset["q"].values, strict=True)
        }

    for seeds in ("", "seeds = independent;"):
        few = by_name(f"{seeds} vary links.bar.mass = [1, 2] kg; repeat 2;")
        more = by_name(f"{seeds} vary links.bar.mass = [0.5, 1, 2] kg; repeat 3;")
        assert len(few) == 4
        assert all(more[name] == bits for name, bits in few.items())


@pytest.mark.slow
def test_an_archive_says_which_repeat_a_case_is(tmp_path: Path) -> None:
    path = ran(tmp_path, compiled(tmp_path, NOISY, "sweep it of hold { vary links.bar.mass = [1, 2] kg; repeat 2; }"))
    dataset = xarray.open_dataset(path, engine="h5netcdf")
    assert dataset["repeat"].values.tolist() == [0, 1, 0, 1]
    assert len(set(dataset["case_key"].values.tolist())) == 4
    with ArchiveFile(path) as archive:
        again = archive.plan().experiments[0]
    assert again.cases.repeats is not None
    assert again.cases.repeats.tolist() == [0, 1, 0, 1]


def test_large_tables_of_groups_go_through_a_plan_file(tmp_path: Path) -> None:
    from met.plan import file as plan_file

    plan = compiled(
        tmp_path,
        TIMED,
        "sweep it of hold { vary drive.kp = linspace(0.1, 0.2, 6000) V*s/rad;"
        " vary integrator = [rk4, midpoint]; vary links.bar.mass = [1, 2] kg; }",
    )
    plan_file.write(plan, tmp_path / "p.json")
    again = plan_file.read(tmp_path / "p.json")
    for one, other in zip(plan.experiments, again.experiments, strict=True):
        assert (one.name, one.cases.choices) == (other.name, other.cases.choices)
        assert np.array_equal(one.cases.table, other.cases.table)
        assert np.array_equal(one.cases.coordinates[0].values, other.cases.coordinates[0].values)


def test_a_value_that_the_engine_did_not_use_fails_its_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault put in on purpose: what reaches the kernel is not what the table has."""
    experiment: Experiment = compiled(
        tmp_path, TIMED, "sweep it of hold { vary links.bar.mass = [1, 2] kg; }"
    ).experiments[0]
    rightly = engine.inputs

    def wrongly(experiment: Experiment, rows: np.ndarray) -> np.ndarray:
        values = rightly(experiment, rows)
        values[-1, 0] = 7.0
        return values

    monkeypatch.setattr(engine, "inputs", wrongly)
    found = engine.run(experiment)
    assert found.status.tolist() == [engine.DONE, engine.FAILED]
    assert "the engine used" in found.cause[1]


@pytest.mark.slow
def test_by_a_metric_the_cases_of_all_structures_are_in_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    compiled(tmp_path, TIMED, STRUCTURES)
    monkeypatch.chdir(tmp_path)
    main(["run", "deck.ic", "it", "-q", "--no-picture"])
    with ArchiveFile("deck.it.h5") as file:
        found = {
            int(group.values("case")[i]): (float(group.values("end")[i]), str(group.values("case_id")[i])[:8])
            for group in file.groups
            for i in range(group.count)
        }
    for more, sign in ((["--reverse"], -1.0), ([], 1.0)):
        capsys.readouterr()
        assert main(["show", "deck.it.h5", "--sort", "end", *more]) == 0
        told = capsys.readouterr().out
        rows = [line.split() for line in told.splitlines() if line.lstrip().startswith("#")]
        order = sorted(found, key=lambda case: sign * found[case][0])
        assert [(row[0], row[1]) for row in rows] == [(f"#{case}", found[case][1]) for case in order]
        assert {row[2] for row in rows} == {"drive", "brisk"}
        assert [row[-1] for row in rows] == ["met" if found[case][0] > 0.15 else "missed" for case in order]
    assert "it, cases by end, smallest first:\n" in told and "velocity products" not in told
    assert main(["show", "deck.it.h5", "hinge.q", "--sort", "end", "--run", "it.brisk"]) == 0
    told = capsys.readouterr().out
    assert "\ncases by end, smallest first:\n" in told and "hinge.q" in told


@pytest.mark.slow
def test_by_a_metric_that_one_of_two_sweeps_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    brief = "run brief like hold { metric soon = max { of = hinge.q; } }\n"
    other = "sweep both of brief { vary links.bar.mass = [1, 2] kg; vary hinge.servo = [drive, brisk]; }\n"
    compiled(tmp_path, TIMED, STRUCTURES, brief, other)
    monkeypatch.chdir(tmp_path)
    main(["run", "deck.ic", "it", "both", "-q", "--no-picture", "-o", "two.h5"])
    capsys.readouterr()
    assert main(["show", "two.h5", "--sort", "soon"]) == 0
    told = capsys.readouterr().out
    assert "both, cases by soon, smallest first:\n" in told and "it, cases by" not in told
    assert told.count("cases, closest to a limit first:\n") + told.count("cases, worst first:\n") == 2
