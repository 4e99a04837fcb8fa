"""The fuzzer for a hundred decks, and the smallest decks of what it has found."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import ic
from tests.ic.fuzz import mutations, one, sweeps, worker
from tests.ic.fuzz.__main__ import ROOT, Fault, Findings, fuzz, told

ARM = """\
arm chain {
    link bar { mass = 4 kg;  shape = rod(length = 0.5 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
run swing {
    arm      = chain;
    rates    { dynamics = 500 Hz;  record = 100 Hz; }
    duration = 1 s;
    record   = [q];
}
"""


SEED, DECKS = 20261128, 100
"""Which decks are tried here, each time the same, and how many; `python -m tests.ic.fuzz` tries others."""


@pytest.mark.release
def test_decks_that_nobody_would_write_show_no_fault() -> None:
    found = fuzz(SEED, 1200.0, decks=DECKS)
    assert not found.faults, told(found, SEED)
    assert found.decks == DECKS


def test_what_was_found_stays_mended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of more ticks than a plan may have was sound for `met check`, and its plan file damaged for `met run`."""
    monkeypatch.chdir(tmp_path)
    deck = Path("deck.ic")
    deck.write_text(ARM.replace("1 s;", "999999999999 s;"))
    assert one.fault_of(deck) is None
    assert [d.code for d in ic.check(deck).diagnostics] == ["D103"]


def test_a_model_that_acts_on_the_world_of_an_empty_arm_is_no_fault(tmp_path: Path) -> None:
    """The warning of models that change nothing looked for a link that is not the world."""
    deck = tmp_path / "deck.ic"
    plume = "plume { link = world; width = 1 m; height = 1 m; nozzle = [0, 0, 1] m; axis = [0, 0, 1]; thrust = 2 N; }"
    deck.write_text(f"arm empty {{}} run it {{ arm = empty; environment {{ jet = {plume} }} }}")
    assert one.fault_of(deck) is None
    assert "D159" in [diagnostic.code for diagnostic in ic.check(deck).diagnostics]


@pytest.mark.release
def test_a_deck_of_the_series_is_the_same_each_time() -> None:
    assert mutations.changed_bytes(_rng(), ARM.encode()) == mutations.changed_bytes(_rng(), ARM.encode())
    for change in mutations.GENTLE:
        assert change(_rng(), ARM) == change(_rng(), ARM)


def _rng() -> random.Random:
    return random.Random("7")


# the fuzzer itself: what it must see


def test_a_traceback_is_a_fault_told_with_a_short_deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(path: Path, **_more: object) -> None:
        if b"hinge" in Path(path).read_bytes():
            raise KeyError("hinge")
        raise ValueError("another fault")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ic, "check", breaks)
    deck = Path("deck.ic")
    deck.write_text(ARM)
    fault = one.fault_of(deck)
    assert fault is not None
    assert fault[0].startswith("KeyError in")
    assert worker.shortened(ARM.encode(), lambda data: worker._still(deck, fault[0], data)) == b"hinge"


def test_a_deck_that_takes_too_long_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def hangs(_path: Path, **_more: object) -> None:
        while True:
            pass

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ic, "check", hangs)
    monkeypatch.setattr(one, "MOST_SECONDS", 0.05)
    Path("deck.ic").write_text(ARM)
    fault = one.fault_of(Path("deck.ic"))
    assert fault is not None
    assert fault[0].startswith("Hung in")


@pytest.mark.slow
def test_a_deck_that_takes_too_much_memory_is_a_fault() -> None:
    """In a process of its own, which is then limited for good."""
    script = "from tests.ic.fuzz import one; one.limit_memory(); kept = bytearray(2**29); bytearray(2**30)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=Path(__file__).parents[3])
    assert done.stderr.endswith("MemoryError\n")


@pytest.mark.slow
def test_a_soundly_compiled_deck_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text("#include <two_link.ic>\n")
    assert one.fault_of(Path("deck.ic")) is None


def test_findings_are_told_with_their_decks() -> None:
    found = Findings(12, (Fault("KeyError in a.py:f", 7, "x = 1;", "Traceback ...\n"),), (0.5, 3))
    assert (
        told(found, 5)
        == """\
12 decks of seed 5; the slowest, number 3, took 0.5 s

=== KeyError in a.py:f (deck 7)
Traceback ...

--- the deck
x = 1;"""
    )


STAND_IN = """\
import sys
from tests.ic.fuzz import __main__ as fuzzer
fuzzer.sys.executable = sys.argv[1]
sys.argv[1:] = ["--seconds", "600", "--seed", "5", "--keep", sys.argv[2]]
fuzzer.main()
"""
FINDS_AND_STAYS = """\
#!/bin/sh
echo '{"begun": 7}'
echo '{"fault": "KeyError in a.py:f", "number": 7, "traceback": "Traceback ...", "deck": "x = 1;"}'
exec sleep 600
"""


def test_a_fault_is_told_and_kept_before_the_fuzzer_ends(tmp_path: Path) -> None:
    worker = tmp_path / "worker"
    worker.write_text(FINDS_AND_STAYS)
    worker.chmod(0o755)
    command = [sys.executable, "-c", STAND_IN, str(worker), str(tmp_path / "kept")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, start_new_session=True) as fuzzer:
        assert fuzzer.stdout is not None
        try:
            lines = [fuzzer.stdout.readline() for _ in range(6)]
        finally:
            os.killpg(fuzzer.pid, signal.SIGKILL)
    assert lines == [
        "seed 5\n",
        "\n",
        "=== KeyError in a.py:f (deck 7)\n",
        "Traceback ...\n",
        "--- the deck\n",
        "x = 1;\n",
    ]


@pytest.mark.slow
def test_some_random_sweeps_show_no_fault(tmp_path: Path) -> None:
    """All kinds of axes, with one case and with several, over one deck; the test below tries many more of all."""
    decks = ("two_link.ic",)
    told = [sweeps.fault_of(f"some/{n}", tmp_path, rough=0.0 if n % 3 else 0.1, decks=decks) for n in range(20)]
    assert [f"{text}\n{fault}" for text, fault, _ in told if fault] == []
    assert sum(compiled for _, _, compiled in told) > 5


@pytest.mark.release
def test_a_hundred_random_sweeps_show_no_fault(tmp_path: Path) -> None:
    assert sweeps.main(f"{SEED}", 100, tmp_path) == 0
