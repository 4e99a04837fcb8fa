"""What comes of a case whose bed was never armed, whose line was lost, or whose records nobody made."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import batch
from batch.beds.executor import OnBeds
from hw.recording import records
from met import cli
from tests.batch.beds.listening import DECK
from tests.hw.device import DEAD, DISARMED, STOPPED, Device

pytestmark = pytest.mark.slow

__all__ = ["DECK"]  # deck.ic

Met = Callable[..., tuple[int, str, str]]
LIMITS = (60.0, 3.0, 1000.0, 5.0, 2e5, 1e4, 1e9)
"""Of a device that bears what the deck asks of it."""

RECORDS = Path("a.h5.campaign/beds/0-0.records")


def run(met_bed: Met, port: str, *words: str) -> tuple[int, str, str]:
    return met_bed("run", "deck.ic", "wired", "--port", port, "-o", "a.h5", "--no-picture", *words)


@pytest.mark.release
def test_a_case_whose_bed_did_not_arm_is_driven_the_next_time(met_bed: Met, on_pty: Callable[..., str]) -> None:
    device = Device(limits=LIMITS)
    device.state, device.faults = STOPPED, DEAD
    port = on_pty(device)
    status, _, complaint = run(met_bed, port, "--lock-step")
    assert status == cli.BAD_INPUT
    assert (
        complaint
        == f"""\
error[E406]: bed `model` has stopped itself, and is to be cleared first: torque did not change the measured rate
 = help: look whether the tachometer is connected, and whether the shaft is free
 = help: then `met bed clear --port {port}`; `met bed run --clear` does so before each case

1 error
"""
    )
    assert not Path("a.h5").exists()
    assert met_bed("clear", "--port", port) == (
        cli.YES,
        f"""\
bed `model` at {port}: cleared: torque did not change the measured rate
  = help: look whether the tachometer is connected, and whether the shaft is free
""",
        "",
    )
    assert met_bed("clear", "--port", port, "--format", "json")[1] == '{"name": "model", "cleared": []}\n'
    assert device.state == DISARMED
    status, said, complaint = run(met_bed, port, "--lock-step")
    assert (status, complaint) == (cli.YES, "") and "the case reached its end" in said


@pytest.mark.release
@pytest.mark.parametrize(
    "begun",
    [
        b"",
        records.MAGIC[:5],
        records.MAGIC,
        records.MAGIC + (400).to_bytes(8, "little") + b'{"key": "',
    ],
)
def test_records_that_were_cut_short_before_the_first_are_made_anew(
    met_bed: Met, monkeypatch: pytest.MonkeyPatch, begun: bytes
) -> None:
    def killed(self: OnBeds, section: object, row: int, path: Path, told: Path) -> None:
        path.write_bytes(begun)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(OnBeds, "_drive", killed)
        assert run(met_bed, "emulated")[0] == 130
    assert RECORDS.read_bytes() == begun
    assert run(met_bed, "emulated")[0] == cli.YES


def test_a_line_that_is_lost_ends_the_case_and_the_archive_has_what_was_before(met_bed: Met) -> None:
    device = Device(limits=LIMITS)
    server = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        line, _ = server.accept()
        with server, line:
            while len(device.commanded) < 50:
                line.sendall(device.take(line.recv(4096)))

    thread = threading.Thread(target=answer)
    thread.start()
    port = f"socket://127.0.0.1:{server.getsockname()[1]}"
    status, said, complaint = run(met_bed, port, "--lock-step")
    thread.join()
    assert status == cli.NO, complaint
    assert f"the line to the bed on {port} was lost: " in said
    data = batch.open("a.h5")
    assert int(data.status[0]) == 1 and int(data.n_valid[0]) == 6
    assert not Path("a.h5.campaign").exists()


def test_records_of_another_version_are_told(met_bed: Met, monkeypatch: pytest.MonkeyPatch) -> None:
    row = records.packed(0, 0, 0, (0, 0, 0, 0), 0.0, 0.0, None)
    text = b'{"key": "x"}'
    data = records.MAGIC + len(text).to_bytes(8, "little") + text + row
    monkeypatch.setattr(OnBeds, "_drive", lambda self, section, row, path, told: path.write_bytes(data))
    status, _, complaint = run(met_bed, "emulated")
    assert status == cli.BAD_INPUT
    assert complaint.endswith("""\
error[E413]: the file of records of case #0 was written by another version of MET
 = help: remove a.h5.campaign/beds/0-0.records

1 error
""")


SWEEP = DECK + "sweep tuning of wired { vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad; }\n"


def sweep(met_bed: Met, port: str, *words: str) -> tuple[int, str, str]:
    Path("deck.ic").write_text(SWEEP)
    return met_bed("run", "deck.ic", "tuning", "--port", port, "--lock-step", "-o", "a.h5", "--no-picture", *words)


@pytest.mark.release
def test_a_sweep_names_a_bed_once(met_bed: Met, on_pty: Callable[..., str]) -> None:
    _, said, _ = sweep(met_bed, on_pty(Device(limits=LIMITS)))
    assert said.count("bed `model`") == 1 and "of 3 cases" in said


@pytest.mark.release
def test_a_sweep_ends_where_a_bed_stopped_itself_and_goes_on_once_it_is_cleared(
    met_bed: Met, on_pty: Callable[..., str]
) -> None:
    port = on_pty(Device(limits=(60.0, 3.0, 20.0, 5.0, 2e5, 1e4, 1e9)))
    for case in range(2):
        status, said, complaint = sweep(met_bed, port)
        assert status == cli.BAD_INPUT and "is to be cleared first: the shaft was faster than its limit" in complaint
        assert said.count("the bed stopped itself: rate") == case + 1 and f"case #{case}, t = 0." in said
        assert met_bed("clear", "--port", port)[0] == cli.YES
    status, said, _ = sweep(met_bed, port)
    assert status == cli.NO and "0 of 3 cases reached their end" in said
    assert [str(cause) for cause in batch.open("a.h5").cause.values if "the bed stopped itself: rate" in cause][2:]


@pytest.mark.release
def test_a_sweep_that_clears_goes_on_by_itself(met_bed: Met, on_pty: Callable[..., str]) -> None:
    device = Device(limits=(60.0, 3.0, 20.0, 5.0, 2e5, 1e4, 1e9))
    status, said, _ = sweep(met_bed, on_pty(device), "--clear")
    assert status == cli.NO and "0 of 3 cases reached their end" in said
    assert said.count("shoulder: cleared: the shaft was faster than its limit") == 2
    assert (device.voltage, device.current) == (0.0, 0.0)


@pytest.mark.release
def test_what_was_measured_is_not_written_over(met_bed: Met) -> None:
    Path("deck.ic").write_text(SWEEP)
    words = ("run", "deck.ic", "tuning", "--port", "emulated", "-o", "a.h5", "--no-picture")
    assert met_bed(*words)[0] == cli.YES
    status, _, complaint = met_bed(*words, "--case", "#0")
    assert status == cli.BAD_INPUT
    assert "error[E353]: a.h5 holds another campaign, driven on motor beds, and is left as it is" in complaint
    assert len(batch.open("a.h5").case_id) == 3


@pytest.mark.release
@pytest.mark.compiler
def test_a_transcript_of_another_run_is_refused_and_then_the_right_one_is_replayed(met_bed: Met) -> None:
    Path("deck.ic").write_text(SWEEP)
    Path("kept").mkdir()
    words = ("--lock-step", "--transcripts", "kept", "--no-picture")
    assert met_bed("run", "deck.ic", "tuning", "--port", "firmware", "-o", "a.h5", *words)[0] == cli.YES
    for row, status in ((1, cli.BAD_INPUT), (0, cli.YES)):
        port = f"kept/tuning.{row}.shoulder.transcript"
        found, _, complaint = met_bed(
            "run", "deck.ic", "tuning", "--case", "#0", "--port", port, "-o", "b.h5", "--no-picture"
        )
        assert found == status and ("error[E407]" in complaint) == (row == 1)
    assert batch.open("b.h5").q.values.tobytes() == batch.open("a.h5").q.values[:1].tobytes()


@pytest.mark.release
@pytest.mark.compiler
def test_a_transcript_that_was_broken_off_is_replayed_to_where_it_ends(met_bed: Met) -> None:
    Path("kept").mkdir()
    assert run(met_bed, "firmware", "--lock-step", "--transcripts", "kept")[0] == cli.YES
    [transcript] = Path("kept").iterdir()
    transcript.write_bytes(transcript.read_bytes()[:60_000])
    status, said, _ = met_bed("run", "deck.ic", "wired", "--port", str(transcript), "-o", "b.h5", "--no-picture")
    assert status == cli.NO and f"{transcript} ends after tick " in said
    whole, part = batch.open("a.h5"), batch.open("b.h5")
    rows = int(part.n_valid[0])
    assert 10 < rows < 100 and part.q.values[0, :rows].tobytes() == whole.q.values[0, :rows].tobytes()


@pytest.mark.release
def test_cases_that_were_driven_elsewhere_are_not_taken_for_driven_here(
    met_bed: Met, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(met_bed, "emulated")[0] == cli.YES
    assert run(met_bed, "firmware", "--lock-step")[0::2] == (
        cli.BAD_INPUT,
        """\
error[E353]: a.h5 holds this campaign, driven at `emulated`, and is left as it is
 = help: `--fresh` starts over, and removes what is done; `-o OTHER.h5` leaves it, and runs beside it

1 error
""",
    )
    assert "nothing is missing" in run(met_bed, "emulated")[1]

    def ended(self: OnBeds, task: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("batch.beds.executor.shard.write", ended)
        Path("a.h5").unlink()
        assert run(met_bed, "emulated")[0] == 130
    assert "a.h5.campaign holds cases of this campaign, driven at `emulated`" in run(met_bed, "qemu", "--lock-step")[2]
    assert run(met_bed, "emulated")[0] == cli.YES
