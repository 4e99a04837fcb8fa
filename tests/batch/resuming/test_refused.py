"""What is begun is gone on with by nobody else, and by no other campaign."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

import batch
import ic
from met.plan import Plan
from met.plan import file as plan_file
from tests.batch import plans, whole
from tests.batch.begun import CASES, OF_TASK, begin, go_on, plan, refused

DECK = """
#include <two_link.ic>

run brief like nominal { duration = 2 s; }

sweep it of brief {
    vary gearbox.kp = linspace(0.010, 0.040, 40) V*s/rad;
}
"""


# Two at once


@pytest.mark.slow
def test_a_second_driver_is_refused(archive: Path, undisturbed: bytes) -> None:
    said = []
    executor = whole.Watched(after=2, then=lambda: said.append(refused(archive)))
    batch.run(plan(), output=archive, executor=executor)
    assert said == [
        f"error[E307]: cannot write {archive}: another run is writing it now\n"
        f" = help: `met status {archive}` says how far it is\n"
        " = help: wait until it is done, or give another name with `-o`\n"
        "\n1 error\n"
    ]
    assert archive.read_bytes() == undisturbed


@pytest.mark.release
def test_a_second_process_is_refused(archive: Path, tmp_path: Path) -> None:
    of = plans.plan(whole.long(2_000))
    cases = of.experiments[0].cases.count
    plan_file.write(of, tmp_path / "p.json")
    words = ["run", str(tmp_path / "p.json"), "-o", str(archive), "--no-picture"]
    with whole.started(words, archive.parent, whole.SHORT_TASKS) as first:
        whole.until(lambda: whole.done(archive, cases), first)
        first.send_signal(signal.SIGSTOP)  # it is still at work when the last of the others has been refused
        for more in ((), ("--fresh",), ("--processes", "2")):
            second = whole.met([*words, *more], archive.parent)
            assert (second.returncode, second.stderr) == (
                2,
                f"error[E307]: cannot write {archive}: another run is writing it now\n"
                f" = help: `met status {archive}` says how far it is\n"
                " = help: wait until it is done, or give another name with `-o`\n"
                "\n1 error\n",
            )
        first.send_signal(signal.SIGCONT)
        out, err = first.communicate(timeout=whole.PATIENCE_SECONDS)
    assert first.returncode == 0, err
    assert f"{cases:,} of {cases:,} cases reached their end" in out
    serial = batch.run(of, output=tmp_path / "serial.h5", threads=1).path
    assert archive.read_bytes() == serial.read_bytes()


# Another campaign


def compiled(folder: Path, *changes: tuple[str, str]) -> Plan:
    """The deck, with texts replaced; the folder is the current one."""
    text = DECK
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "d.ic").write_text(text)
    return ic.compile("d.ic", select=["it"])


def with_entry(entry: str) -> tuple[str, str]:
    """A change that adds an entry to the run."""
    return ("duration = 2 s;", f"duration = 2 s;  {entry}")


AXIS = "gearbox.kp = linspace(0.010, 0.040, 40) V*s/rad"
CHANGES: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    "the range of an axis": (
        ("0.040", "0.050"),
        ("gearbox.kp: 40 values from 0.01 to 0.04 V*s/rad -> 40 values from 0.01 to 0.05 V*s/rad",),
    ),
    "values between": (
        (AXIS, "gearbox.kp = logspace(0.010, 0.040, 40) V*s/rad"),
        ("gearbox.kp: other values (40 values from 0.01 to 0.04 V*s/rad)",),
    ),
    "how many values": (
        ("40)", "41)"),
        (
            "40 cases -> 41 cases",
            "gearbox.kp: 40 values from 0.01 to 0.04 V*s/rad -> 41 values from 0.01 to 0.04 V*s/rad",
        ),
    ),
    "another axis": (
        (AXIS, "gearbox.ki = linspace(0.1, 0.2, 40) V/rad"),
        (
            "gearbox.kp is not varied any more",
            "gearbox.ki is varied now: 40 values from 0.1 to 0.2 V/rad",
            "elbow.servo.ki: 0.125 V/rad -> varied (d.ic:7)",
            "elbow.servo.kp: varied -> 0.02 V*s/rad (<servos/rigid_gearbox.ic>:14)",
            "shoulder.servo.ki: 0.125 V/rad -> varied (d.ic:7)",
            "shoulder.servo.kp: varied -> 0.02 V*s/rad (<servos/rigid_gearbox.ic>:14)",
        ),
    ),
    "a parameter": (
        with_entry("servos { elbow { f_c = 0.03 N*m; } }"),
        ("elbow.servo.f_c: 0.0205 N*m -> 0.03 N*m (d.ic:4)",),
    ),
    "a rate": (with_entry("rates { record = 12.5 Hz; }"), ("rates.record: 25 Hz -> 12.5 Hz",)),
    "a signal": (with_entry("record += [qdd];"), ("record: qdd is new",)),
    "a metric": (with_entry("metric end = final { of = elbow.q; }"), ("metric end is new",)),
    "the integrator": (with_entry("integrator = rk4;"), ("integrator: modified_euler -> rk4",)),
}


@pytest.mark.release
@pytest.mark.parametrize("what", CHANGES)
def test_another_campaign_is_left_alone(archive: Path, here: Path, what: str) -> None:
    change, told = CHANGES[what]
    kept = begin(archive, compiled(here))
    more = "".join(f" = help:                {line}\n" for line in told[1:])
    assert refused(archive, compiled(here, change)) == (
        f"error[E353]: {archive}.campaign holds {OF_TASK * len(kept)} cases of another campaign, and is left as it is\n"
        f" = help: changed since: {told[0]}\n"
        f"{more}"
        " = help: `--fresh` starts over, and removes what is done; `-o OTHER.h5` leaves it, and runs beside it\n"
        "\n1 error\n"
    )
    assert whole.shards(archive) == kept
    rest, _ = go_on(archive, compiled(here))
    assert not kept.keys() & set(rest.names)


@pytest.mark.slow
@pytest.mark.parametrize("histories", ["all", "none"])
def test_another_duration_is_another_campaign(archive: Path, here: Path, histories: str) -> None:
    begin(archive, compiled(here), histories=histories)
    said = refused(archive, compiled(here, ("duration = 2 s", "duration = 4 s")), histories=histories)
    assert " = help: changed since: duration: 2 s -> 4 s\n" in said


KEPT: dict[str, tuple[dict[str, Any], str]] = {
    "none": ({"histories": "none"}, "what is kept of histories (`--histories`, `--float32`)"),
    "float32": ({"float32": True}, "what is kept of histories (`--histories`, `--float32`)"),
    "every": ({"histories": "every:2"}, "what is kept of histories (`--histories`, `--float32`)"),
    "cases": ({"cases": ["#3", "#4"]}, "other cases were asked for"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", KEPT)
def test_what_else_was_asked_for_is_another_campaign(archive: Path, what: str) -> None:
    options, told = KEPT[what]
    kept = begin(archive)
    assert f" = help: changed since: {told}\n" in refused(archive, **options)
    assert whole.shards(archive) == kept


@pytest.mark.slow
def test_whose_histories_are_kept_may_change_on_the_way(archive: Path) -> None:
    kept = begin(archive, histories="worst:3")
    rest, _ = go_on(archive, histories="worst:4")
    assert not kept.keys() & set(rest.names)
    with batch.open(archive) as data:
        assert data.sizes["recorded_case"] == 4


@pytest.mark.slow
def test_starting_over_says_what_it_removes(archive: Path, here: Path) -> None:
    kept = begin(archive, compiled(here))
    changed = compiled(here, ("0.040", "0.050"))
    _, notes = go_on(archive, changed, fresh=True)
    assert notes == (f"starts over: {OF_TASK * len(kept)} cases that were done before are removed",)
    alone = batch.run(changed, output=here / "alone.h5", threads=1).path
    assert archive.read_bytes() == alone.read_bytes()


@pytest.mark.slow
def test_starting_over_where_nothing_was_begun(archive: Path, undisturbed: bytes) -> None:
    go_on(archive)
    rest, notes = go_on(archive, fresh=True)
    assert (rest.cases, notes) == (CASES, ())
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [("run brief", "// gently\n\nrun brief"), with_entry("require settle < 1.5 s;")], ids=["comment", "limit"]
)
def test_what_changes_no_number_refuses_nothing(archive: Path, here: Path, change: tuple[str, str]) -> None:
    kept = begin(archive, compiled(here))
    changed = compiled(here, change)
    rest, _ = go_on(archive, changed)
    assert not kept.keys() & set(rest.names)
    alone = batch.run(changed, output=here / "alone.h5", threads=1).path
    assert archive.read_bytes() == alone.read_bytes()
