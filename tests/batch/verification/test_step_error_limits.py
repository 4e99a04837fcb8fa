"""Requirements on errors by the step: what comes of them, and that an archive's are data."""

from __future__ import annotations

import json
import math
from pathlib import Path

import h5py
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.summary import as_json
from batch.report.contents.gathering import gather
from batch.terminal.running import run_and_tell
from batch.terminal.show import verdict
from met.diagnostic import Problem

DECK = """#include <two_link.ic>
run brief like nominal {{
    duration = 3 s;
    metric turn = final {{ of = elbow.q; }}
    {required}
}}
sweep gain of brief {{ vary gearbox.kp = [0.02, 0.021, 0.03] V*s/rad; }}
"""


def made(here: Path, required: str, run: str = "brief", verify: str = "auto") -> batch.Archive:
    return batch.run(ic.compile(text=DECK.format(required=required), select=[run]), output=here / "a.h5", verify=verify)  # type: ignore[arg-type]


def said(archive: batch.Archive) -> list[str]:
    return [line for line in verdict(archive.summaries[0], 100) if "step_error" in line]


@pytest.mark.release
def test_a_share_and_a_size_are_met_and_missed(tmp_path: Path) -> None:
    archive = made(tmp_path, "require step_error(turn) < 1 %; require step_error(turn) < 1e-4 rad;")
    assert said(archive) == [
        "  require step_error(turn) < 1 %       met: 0.21 % in case #0",
        "  require step_error(turn) < 1e-4 rad  missed: 0.00015 rad in case #0",
    ]
    assert not archive.ok
    assert made(tmp_path, "require step_error(turn) < 1 %;").ok
    [first] = json.loads(json.dumps(as_json(archive.summaries[0])))["step_errors"][:1]
    assert first == {"text": "step_error(turn) < 1 %", "met": True, "said": "0.21 % in case #0"}


@pytest.mark.release
def test_it_is_verified_by_itself_and_unknown_where_that_is_refused(tmp_path: Path) -> None:
    bare = made(tmp_path, "", "gain")
    assert bare.summaries[0].verified is None  # three cases are too dear
    assert made(tmp_path, "require step_error(turn) < 1 %;", "gain").ok
    archive = made(tmp_path, "require step_error(turn) < 1 %;", "gain", "none")
    assert not archive.ok
    assert said(archive) == [
        "  require step_error(turn) < 1 %  not known: nothing is verified: `met run --verify some`"
    ]


@pytest.mark.slow
def test_the_exit_status_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.ic").write_text(DECK.format(required="require step_error(turn) < 0.1 %;"))
    assert not run_and_tell("d.ic", ("brief",), no_picture=True)
    assert capsys.readouterr().out.splitlines()[-1] == "exit 1: not met, or not known: step_error(turn) < 0.1 %"


@pytest.mark.slow
def test_a_report_says_so(tmp_path: Path) -> None:
    with ArchiveFile(made(tmp_path, "require step_error(turn) < 0.1 %;").path) as file:
        [found] = gather(file, (), "").verdicts
    assert not found.ok
    assert found.notes == ("step_error(turn) < 0.1 %: missed, 0.21 % in case #0.",)


@pytest.mark.slow
def test_an_infinite_value_at_one_step_alone_misses_and_at_every_step_has_no_error(tmp_path: Path) -> None:
    archive = made(tmp_path, "require step_error(settle) < 0.1 s;", "gain", "all")
    assert said(archive) == [
        "  require step_error(settle) < 0.1 s  met: 0.05 s in case #2, the worst of 3 verified cases"
    ]
    with h5py.File(archive.path, "r+") as file:
        column = list(file["verification/verified_metric"].asstr()).index("settle")
        file["verification/half"][1, column] = math.inf
        file["settle"][0] = file["verification/half"][0, column] = file["verification/quarter"][0, column] = math.inf
    [line] = said(batch.look(archive.path))
    assert line.endswith(
        "missed: infinite at half the step, and not at another in case #1, the worst of 2 verified cases"
    )


@pytest.mark.release
@pytest.mark.parametrize(
    "forged",
    [
        "no JSON",
        "{}",
        "[1]",
        '[{"text":"a","metric":"nothing","comparison":"<","limit":1.0,"share":true}]',
        '[{"text":"a","metric":"turn","comparison":">","limit":1.0,"share":true}]',
        '[{"text":"a","metric":"turn","comparison":"<","limit":1e999,"share":true}]',
        '[{"text":"a","metric":"turn","comparison":"<","limit":-1.0,"share":true}]',
        '[{"text":"a","metric":"turn","comparison":"<","limit":1.0}]',
        "[" * 5000,
    ],
)
def test_a_forged_attribute_is_refused(tmp_path: Path, forged: str) -> None:
    archive = made(tmp_path, "require step_error(turn) < 1 %;")
    with h5py.File(archive.path, "r+") as file:
        file.attrs["step_errors"] = forged
    with pytest.raises(Problem, match="E302") as caught, ArchiveFile(archive.path):
        pass
    message = f"the archive {archive.path} is damaged: attribute `step_errors` is no list of requirements"
    assert caught.value.diagnostics[0].message == message
