"""What `met bed run` tells of a case while it is driven, and writes beside the archive."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.beds.case_result import CaseRecords
from batch.beds.executor import Driving, OnBeds, Ports
from batch.beds.running import BedProgress, beds_before, timing_lines, timings
from batch.beds.running import sidecar_entries as written_beside
from batch.campaigns.folder import Folder
from batch.campaigns.output import sidecar_path
from batch.terminal.progress import Bar
from hw.bed import BedSample, BedState, Fault
from hw.recording import records
from hw.recording.records import SIZE
from met import cli
from met.diagnostic import Problem
from tests.batch.beds.listening import DECK
from tests.batch.beds.test_jitter import rows_of
from tests.hw.drives.played import bench_file

FIGURES = {"median", "p99", "p99.9", "largest"}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.ic").write_text(DECK)
    return tmp_path


def beside(*words: str) -> object:
    """What the run wrote of its beds."""
    assert cli.main(["bed", "run", "deck.ic", *words, "-o", "a.h5", "--no-picture", "-q"]) in (cli.YES, cli.NO)
    return json.loads(Path("a.h5.run.json").read_text())["beds"]


@pytest.mark.release
def test_beds_stand_beside_the_archive(here: Path) -> None:
    [found] = beside("wired", "--port", "firmware")  # type: ignore[misc]
    timing, beds = found.pop("timing"), found.pop("beds")
    assert found == {"joint": "shoulder", "port": "firmware", "baud": 921600, "lock_step": False}
    assert [each["name"] for each in beds] == ["simulated"] and len(beds[0]["firmware"]) == 16
    assert 0 < timing["exchanges"] <= 1000
    assert set(timing["lateness"]) == set(timing["trip"]) == set(timing["computing"]) == FIGURES
    assert 0.0 < timing["trip"]["median"] <= timing["trip"]["p99"] <= timing["trip"]["largest"] < 1.0


@pytest.mark.release
def test_beds_in_lock_step_have_no_timing(here: Path) -> None:
    assert beside("wired", "--port", "emulated") == [
        {
            "joint": "shoulder",
            "port": "emulated",
            "baud": 921600,
            "lock_step": True,
            "beds": [{"name": "emulated", "firmware": "0" * 16}],
            "timing": None,
        },
    ]


def test_cases_of_one_bench_are_not_those_of_another(here: Path) -> None:
    bench = bench_file(here, "damiao")
    folder = Folder(here / "a.h5.campaign")
    folder.path.mkdir()

    def at(port: str) -> OnBeds:
        return OnBeds(Ports({"shoulder": port}, 921600))

    first = at(f"can:{bench}")
    first.open(folder, {}, lambda: None)
    with (folder.beds / "0-0.records").open("wb") as file:
        records.begin(file, {"ports": first.ports.by_joint, "benches": first.benches})
    beside = {"beds": written_beside(first)["beds"]}
    sidecar_path(here / "a.h5").write_text(json.dumps(beside))
    moved = bench.rename(here / "moved.toml")
    bench.write_text(moved.read_text().replace('"damiao"', '"moteus"').replace("1.3e-4", "1.4e-4"))
    at(f"can:{moved}").open(folder, {}, lambda: None)
    at(f"can:{moved}").check(*beds_before(here / "a.h5"), "a.h5 holds this campaign")
    with pytest.raises(Problem) as resumed:
        at(f"can:{bench}").open(folder, {}, lambda: None)
    with pytest.raises(Problem) as whole:
        at(f"can:{bench}").check(*beds_before(here / "a.h5"), "a.h5 holds this campaign")
    for caught, what in ((resumed, f"{folder.path} holds cases of"), (whole, "a.h5 holds")):
        [found] = caught.value.diagnostics
        assert found.code == "E353"
        assert found.message == f"{what} this campaign, driven at `can:{bench}`, and is left as it is"
        assert found.help[:3] == (
            "changed since: the bench, shaft.inertia: 0.00013 kg*m^2 -> 0.00014 kg*m^2",
            "               the bench, drive.dialect: damiao -> moteus",
            "               the bench, load.dialect: damiao -> moteus",
        )
    # an archive of before benches were known is taken for one of the port of the same name, and of no other
    unknown = {"shoulder": f"can:{bench}"}
    at(f"can:{bench}").check(unknown, {}, "a.h5 holds this campaign")
    with pytest.raises(Problem, match="driven at"):
        at(f"can:{moved}").check(unknown, {}, "a.h5 holds this campaign")


def test_cases_of_an_earlier_run_count_as_well(here: Path) -> None:
    executor, folder = OnBeds(Ports({"elbow": "a", "shoulder": "b"}, 921600)), Folder(here / "a.h5.campaign")
    folder.path.mkdir()
    executor.open(folder, {}, lambda: None)
    head = {
        "key": "",
        "row": 3,
        "repeats": 1,
        "joints": ["shoulder", "elbow"],
        "tick_hz": 1000.0,
        "beds": [{"name": each, "firmware": "00"} for each in ("one", "two")],
    }
    sample = BedSample(BedState.ARMED, True, Fault(0), False, 7, 0.0)
    with (folder.beds / "0-3.records").open("wb") as file:
        records.begin(file, head)
        for e in range(3):
            for bed in range(2):
                file.write(records.packed(e, bed, 0, (0, 1000, 6000 * (bed + 1), 0), 0.0, 0.0, sample))
    (folder.beds / "0-4.records").write_bytes(b"nothing")
    found = {each["joint"]: each for each in written_beside(executor)["beds"]}
    assert [found[joint]["beds"][0]["name"] for joint in ("shoulder", "elbow")] == ["one", "two"]
    assert [found[joint]["timing"]["exchanges"] for joint in ("shoulder", "elbow")] == [2, 2]
    assert [found[joint]["timing"]["trip"]["median"] for joint in ("shoulder", "elbow")] == [5e-6, 11e-6]


@pytest.mark.slow
def test_nothing_of_beds_stands_beside_other_archives(here: Path) -> None:
    batch.run(ic.compile("deck.ic", select=["wired"]), output="a.h5")
    assert "beds" not in json.loads(Path("a.h5.run.json").read_text())


def test_a_case_is_told_by_the_time_that_is_on_the_disk(here: Path) -> None:
    stream, now = io.StringIO(), [0.0]
    executor = OnBeds(Ports({"shoulder": "emulated"}, 921600))
    telling = BedProgress(executor, quiet=False, bar=Bar(stream, lambda: now[0]))
    telling.begin("wired", 4, 1, 0, "emulated")
    path = here / "0-0.records"
    path.write_bytes(bytes(15_000 * SIZE))
    executor.driving = Driving(path, 1000.0, 30.0)
    now[0] = 10.0
    telling.advance(1, 0)
    assert stream.getvalue() == ("wired   38 %  1 of 4 cases, 15 of 30 s  0.05 cases/s  50 s left  emulated\n")
    executor.driving = Driving(here / "none", 1000.0, 30.0)
    assert executor.driving.done == 0.0


def test_a_quiet_run_tells_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    telling = BedProgress(OnBeds(Ports({}, 921600)), quiet=True)
    telling.begin("wired", 4, 1, 0, "emulated")
    telling.advance(1, 0)
    telling.say("anything")
    telling.end()
    assert capsys.readouterr() == ("", "")


def test_the_clock_of_a_bed_goes_on_from_case_to_case() -> None:
    """And the host's begins anew: each case has a drift of its own."""
    executor = OnBeds(Ports({"shoulder": "/dev/ttyUSB0"}, 921600))
    first, second = rows_of(200), rows_of(200)
    second["tick"] += 54_321
    second["due"] = second["due"] * (1.0 + 1e-4)
    second["began"], second["ended"] = second["due"], second["due"]
    for row, rows in enumerate((first, second)):
        executor.known.cases[0, row] = CaseRecords(1000.0, {"shoulder": rows})
    found = timings(executor)["shoulder"]
    assert found.exchanges == 398
    assert found.drift == pytest.approx(-0.5e-4, rel=1e-3)


def told(rows: np.ndarray, hz: float) -> list[str]:
    executor = OnBeds(Ports({"shoulder": "/dev/ttyUSB0"}, 921600))
    executor.known.cases[0, 0] = CaseRecords(hz, {"shoulder": rows})
    return list(timing_lines(executor))


HEAD = "shoulder: 200 exchanges; late by 3 us, p99 3 us; answered in 100 us, p99 100 us; computed in "
LATE = "  a period late: 0 (woken too late 0, computing 0, waiting 0); unanswered: "


def test_a_bed_that_keeps_its_time() -> None:
    rows = rows_of(201)
    rows["computed"] = rows["ended"] - 1_000_000 + 1_800_000
    assert told(rows, 1000.0) == [f"{HEAD}1.8 ms, p99 1.8 ms", f"{LATE}0; the bed's clock: +0 ppm"]


def test_a_bed_whose_ticks_are_not_what_it_announces_is_warned_of() -> None:
    assert told(rows_of(201), 2000.0)[1:] == [
        f"{LATE}0; the bed's clock: -50 %",
        "  warning: the bed says that it ticks at 2000 Hz, and ticks at 1000 Hz: its deadman and slew limits are not "
        "what it says; mend its timer, or its configuration",
    ]
    assert len(told(rows_of(201), 1009.0)) == 2
    assert told(rows_of(201), 985.0)[1].endswith("; the bed's clock: +1.52 %")
    assert "  warning: the bed says that it ticks at 985 Hz, and ticks at 1000 Hz: " in told(rows_of(201), 985.0)[2]


def test_exchanges_without_an_answer_are_warned_of() -> None:
    assert len(told(rows_of(201, silent=(5, 9)), 1000.0)) == 2
    found = told(rows_of(201, silent=(5, 9, 20)), 1000.0)
    assert found[1].startswith(f"{LATE}3; the bed's clock: ")
    assert found[2:] == [
        "  warning: 1.5 % of the exchanges had no answer, and commands were held longer than was computed: "
        "`met bed jitter` and `met bed probe` say more of the line"
    ]


def test_a_clock_of_which_too_little_was_seen_is_not_known() -> None:
    assert told(rows_of(5), 1000.0)[1] == f"{LATE}0; the bed's clock: not known"
