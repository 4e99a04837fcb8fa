"""Going on after MET's own code has changed: renamed cells are no other program, another constant is one."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
from met.program.build import build
from met.run import Prepared
from met.trace.recorder import RecordingTape
from tests.batch import whole
from tests.batch.begun import CASES, OF_TASK, begin, go_on, plan, refused
from tests.met.trace.renaming import renamed


def renamed_cells(patch: pytest.MonkeyPatch) -> None:
    """A MET that calls its cells otherwise."""
    patch.setattr("met.run.build", lambda experiment, **words: renamed(build(experiment, **words), "our {}".format))


def another_constant(patch: pytest.MonkeyPatch) -> None:
    """A MET in which steps are longer by a billionth."""
    write = RecordingTape.write
    patch.setattr(
        RecordingTape,
        "write",
        lambda self, name, value: write(self, name, value * (1.0 + 1e-9) if name == "shoulder.q" else value),
    )


@pytest.mark.slow
def test_a_campaign_that_is_half_done_goes_on_after_a_cell_is_renamed(
    archive: Path, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = begin(archive)
    renamed_cells(monkeypatch)
    recording = Prepared(plan().experiments[0]).recording
    assert "our suspect" in recording.cells and "suspect" not in recording.cells
    rest, notes = go_on(archive)
    assert rest.cases == CASES - OF_TASK * len(kept)
    assert notes == (f"goes on: {OF_TASK * len(kept)} of {CASES} cases are done",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_one_that_other_code_began_is_left_alone(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = begin(archive)
    another_constant(monkeypatch)
    assert refused(archive) == (
        f"error[E353]: {archive}.campaign holds {OF_TASK * len(kept)} cases of another campaign, and is left as it is\n"
        " = help: changed since: MET's own models or code (it was begun by version 0.1.0)\n"
        " = help: `--fresh` starts over, and removes what is done; `-o OTHER.h5` leaves it, and runs beside it\n"
        "\n1 error\n"
    )


class TestOfBeforeKeysHadAVersion:
    """What an older MET began, whose keys were digests of the emitted text."""

    @pytest.fixture(autouse=True)
    def begun(self, archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        with monkeypatch.context() as older:
            older.setattr(Prepared, "work_key", property(lambda self: self.old_code_key))
            self.kept = begin(archive)
        assert self.kept

    @pytest.mark.slow
    def test_it_goes_on(self, archive: Path, undisturbed: bytes) -> None:
        rest, _ = go_on(archive)
        assert rest.cases == CASES - OF_TASK * len(self.kept)
        assert archive.read_bytes() == undisturbed

    def test_it_is_left_alone_where_its_text_is_another(self, archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        another_constant(monkeypatch)
        assert "changed since: MET's own models or code" in refused(archive)

    @pytest.mark.slow
    def test_it_goes_on_in_processes(self, archive: Path, undisturbed: bytes) -> None:
        batch.run(plan(), output=archive, processes=2)
        assert archive.read_bytes() == undisturbed
        assert whole.beside_it(archive) == [archive.name, f"{archive.name}.run.json"]
