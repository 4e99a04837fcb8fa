"""`met bed run`: a deck's sweep on beds, into an archive like any other; whole messages of what is wrong with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.beds.executor import OnBeds
from batch.beds.running import campaign_of, check_margins
from batch.campaigns.campaign import prepare
from hw.recording import records
from met import cli
from met.diagnostic import Problem

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record   = [q, qd, shoulder.bed.load_current];
    remove settle;
    remove volts;
    metric peak = max { of = shoulder.qd; }
    substitute shoulder { bed = emulated(faults = typical);  law = velocity_tracking; }
}
sweep tuning of wired { vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad; }
run slow like wired {
    rates { servos = 100 Hz;  dynamics = 100 Hz; }
    shoulder { bed = emulated; }
    duration = 2 s;
}
run moving like wired { initial { shoulder.qd = 0.01 rad/s; } }
run both like wired { substitute elbow { bed = emulated;  law = velocity_tracking; } }
run soft like wired { remove shoulder;  record = [q]; }
run unstable like wired {
    rates { servos = 100 Hz;  dynamics = 100 Hz; }
    shoulder { bed = emulated(delay = 1);  law = measured_acceleration; }
}
run stiff like wired { shoulder { bed = emulated;  law = measured_acceleration; } }
sweep light of stiff { vary gearbox.kp = [0.02, 1] V*s/rad;  vary gearbox.ratio = [1570, 5000]; }
sweep heavy of stiff { vary links.upper.mass = [40, 60, 50] kg; }
"""


@pytest.fixture
def bed(met_bed: Callable[..., tuple[int, str, str]]) -> Callable[..., tuple[int, str, str]]:
    """`met bed run deck.ic ...`: exit status, what was said, and what was complained of."""
    return lambda *words: met_bed("run", "deck.ic", *words, "--no-picture")


@pytest.mark.compiler
@pytest.mark.parametrize(("port", "more"), [("emulated", ()), ("firmware", ("--lock-step",))])
def test_a_sweep_in_lock_step_has_the_bits_of_the_simulation(
    bed: Callable[..., tuple[int, str, str]], port: str, more: tuple[str, ...]
) -> None:
    status, said, _ = bed("tuning", "--port", port, *more, "-o", "bench.h5")
    assert status == cli.YES and "3 of 3 cases reached their end" in said
    assert "shoulder: r = 1.53, stable to more than 2e+03 with velocity_tracking at 1000 Hz" in said
    batch.run(ic.compile("deck.ic", select=["tuning"]), output="sim.h5")
    found = batch.diff("sim.h5", "bench.h5")
    assert found.verdict == "identical" and found.experiments[0].cases.count == 3
    assert not Path("bench.h5.campaign").exists()


@pytest.mark.release
def test_a_slow_servo_is_repeated_on_the_wire(bed: Callable[..., tuple[int, str, str]]) -> None:
    assert bed("slow", "--port", "emulated", "-o", "slow.h5")[0] == cli.YES
    batch.run(ic.compile("deck.ic", select=["slow"]), output="sim.h5")
    one, other = (batch.open(name).qd.sel(joint="shoulder").values for name in ("slow.h5", "sim.h5"))
    # the plant advances five times a tick there, once here
    assert np.abs(one - other).max() < 2e-3 * np.abs(other).max()


@pytest.mark.release
def test_it_is_not_driven_again_unless_it_is_asked_for(bed: Callable[..., tuple[int, str, str]]) -> None:
    assert bed("wired", "--port", "emulated", "-o", "a.h5")[0] == cli.YES
    before = Path("a.h5").stat().st_mtime_ns
    assert (
        "nothing is missing: a.h5 has all of it (`--fresh` drives it again)"
        in bed("wired", "--port", "emulated", "-o", "a.h5")[1]
    )
    assert Path("a.h5").stat().st_mtime_ns == before
    assert bed("wired", "--port", "emulated", "-o", "a.h5", "--fresh")[0] == cli.YES


@pytest.mark.release
@pytest.mark.compiler
def test_a_transcript_is_replayed_to_the_same_bits(bed: Callable[..., tuple[int, str, str]], here: Path) -> None:
    (here / "kept").mkdir()
    words = ("wired", "--port", "firmware", "--lock-step", "--transcripts", "kept", "-o", "a.h5")
    assert bed(*words)[0] == cli.YES
    [transcript] = (here / "kept").iterdir()
    assert bed("wired", "--port", str(transcript), "-o", "b.h5")[0] == cli.YES
    assert batch.diff("a.h5", "b.h5").verdict == "identical"


@pytest.mark.release
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("moving", "--port", "emulated"),
            """\
error[E416]: joint `shoulder` begins with a rate, and a bed's shaft begins at rest
  --> deck.ic:17:49
   = help: `initial { shoulder.qd = 0 rad/s; }` in the run
""",
        ),
        (
            ("wired", "--port", "firmware"),
            """\
error[E415]: joint `shoulder`: its law takes the bed's delay for none, and over a wire it is a tick
 --> deck.ic:9:5
  = help: `bed = emulated(delay = 1, ...)` in the deck says so
""",
        ),
        (
            ("both", "--port", "emulated"),
            """\
error[E418]: port `emulated`: of which joint?
 = help: each has its own: `--port shoulder=... --port elbow=...`
""",
        ),
        (
            ("both", "--port", "elbow=emulated"),
            """\
error[E418]: no port for the bed of joint `shoulder`
 = help: `--port JOINT=PORT`: a serial line, `emulated`, `firmware`, `qemu`, `can:BENCH.toml`, or a transcript
""",
        ),
        (
            ("both", "--port", "elbow=emulated", "--port", "elbow=firmware"),
            """\
error[E418]: joint `elbow` has two ports
 = help: leave one of the two out
""",
        ),
        (
            ("both", "--port", "elbow=emulated", "--port", "shoulder=firmware"),
            """\
error[E414]: some of the beds have a time of their own, and some have none
 = help: give all beds ports of one kind
""",
        ),
        (
            ("soft", "--port", "emulated"),
            """\
error[E333]: no joint is on a bed here
 = help: a run says so: `substitute JOINT { }`
 = help: name the run or sweep that does, if it is another one
""",
        ),
        (
            ("unstable", "--port", "emulated"),
            """\
error[E419]: case #0, shoulder: r = 1.37, stable to 1.2 with measured_acceleration at 100 Hz: it would not be stable
 = help: `met margin` says what would be; a lighter arm, a faster servo or another law
 = help: `--force` arms it all the same
""",
        ),
        (
            ("light", "--port", "emulated"),
            """\
error[E419]: case #3, shoulder: r = 0.149, stable from 0.182 to 4.01 with measured_acceleration at 1000 Hz: \
it would not be stable
 = help: `met margin` says what would be; a lower gain of the servo's rate loop, a faster servo or a heavier arm
 = help: `--force` arms it all the same
""",
        ),
        (
            ("slow", "--port", "/dev/nobody"),
            """\
error[E400]: /dev/nobody cannot be opened: no such file or directory
""",
        ),
    ],
)
def test_what_is_wrong(
    bed: Callable[..., tuple[int, str, str]], here: Path, words: tuple[str, ...], message: str
) -> None:
    status, said, complaint = bed(*words, "-o", "x.h5")
    assert status == cli.BAD_INPUT
    assert message in complaint
    assert not (here / "x.h5").exists()
    assert "writing" not in said or "E400" in message  # which only the line can tell


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "code", "written", "remedy"),
    [
        ("wired", "E415", "emulated(faults = typical)", "emulated(faults = typical, delay = 1)"),
        ("moving", "E416", "shoulder.qd = 0.01 rad/s;", "shoulder.qd = 0 rad/s;"),
    ],
)
def test_a_case_that_no_bed_can_drive_is_refused_before_anything_is_written_and_driven_once_mended(
    here: Path, name: str, code: str, written: str, remedy: str
) -> None:
    port, stepped = ("firmware", False) if code == "E415" else ("emulated", True)
    deck = here / "deck.ic"
    with pytest.raises(Problem) as caught:
        campaign_of(ic.compile(deck, select=[name]), [name], [port], lock_step=stepped)
    assert caught.value.diagnostics[0].code == code
    deck.write_text(DECK.replace(written, remedy))
    campaign_of(ic.compile(deck, select=[name]), [name], [port], lock_step=stepped)


@pytest.mark.slow
def test_of_a_sweep_the_least_margin_is_said_once_a_joint_and_of_which_case(here: Path) -> None:
    names = ("heavy", "slow", "stiff")
    plan = ic.compile(here / "deck.ic", select=names)
    said = [check_margins(prepare(plan, experiments=[name]), force=False) for name in names]
    assert said == [
        [
            "shoulder: r = 1.54, stable to 5.35 with measured_acceleration at 1000 Hz"
            " (case #1, the least margin of 3 cases)"
        ],
        ["shoulder: r = 1.37, stable to more than 2e+03 with velocity_tracking at 100 Hz"],
        ["shoulder: r = 1.37, stable to 5.35 with measured_acceleration at 1000 Hz"],
    ]
    some = check_margins(prepare(plan, experiments=["heavy"], cases=["#0", "#2"]), force=False)
    assert some[0].endswith(" (case #2, the least margin of 2 cases)")


@pytest.mark.release
def test_killed_midway_everything_up_to_then_is_in_the_archive(here: Path) -> None:
    """SIGKILL of the process that drives the bed, and of who started it."""
    text = DECK.replace("duration = 1 s;\n    record ", "duration = 300 s;\n    record ")
    (here / "deck.ic").write_text(text)
    command = [
        sys.executable,
        "-m",
        "met.cli",
        "bed",
        "run",
        "deck.ic",
        "wired",
        "--port",
        "emulated",
        "-o",
        "a.h5",
        "--no-picture",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
    path = here / "a.h5.campaign" / "beds" / "0-0.records"
    end = time.monotonic() + 60.0
    while not path.exists() or path.stat().st_size < 200 * records.SIZE:
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    size = -1
    while size != path.stat().st_size:  # the writer, in a session of its own, puts the rest on the disk
        size = path.stat().st_size
        time.sleep(1.0)
    found = records.read(path)
    assert len(found.rows) > 200 and found.rows["exchange"].tolist() == list(range(len(found.rows)))
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == cli.NO, done.stderr
    data = batch.open("a.h5")
    assert int(data.status[0]) == 1 and "the host was gone" in str(data.cause.values[0])
    rows = int(data.n_valid[0])
    assert abs(rows - (len(found.rows) - 1) // 10) <= 1
    batch.run(ic.compile("deck.ic", select=["wired"]), output="sim.h5")
    assert np.array_equal(data.q.values[0, :rows], batch.open("sim.h5").q.values[0, :rows])


@pytest.mark.slow
def test_a_file_that_holds_no_records_is_told(
    bed: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(OnBeds, "_drive", lambda self, section, row, path, told: path.write_bytes(b"no records"))
    status, _, complaint = bed("wired", "--port", "emulated", "-o", "a.h5")
    assert status == cli.BAD_INPUT
    assert complaint.endswith("""\
error[E413]: the file of records of case #0 holds no records of a bed
 = help: remove a.h5.campaign/beds/0-0.records

1 error
""")


@pytest.mark.slow
def test_a_process_that_ends_without_a_word_is_told(
    bed: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hw.driving.process.sys.executable", "/bin/false")
    status, _, complaint = bed("wired", "--port", "emulated", "-o", "a.h5")
    assert status == cli.BAD_INPUT
    assert complaint.endswith("""\
error[E417]: the process that drives the beds ended with 1
 = help: the beds stop themselves; run it again

1 error
""")
