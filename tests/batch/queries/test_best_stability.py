"""What `met best` says of the stability of servo loops: of a sweep's design, and of a tuning's."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.answer_outcome import answer_outcome
from batch.queries.best import Designs
from batch.queries.best_answer import BestAnswer
from batch.queries.pool import Pool
from batch.queries.search_answers import SearchAnswer
from batch.report.contents.designs import design_answer, search_answer
from met.cli import main
from met.plan.codec import encode
from met.plan.searches import JudgedDesign, LeastMargins
from tests.batch.slider import swing

# A servo whose motor turns the rotor of its gearbox through a spring: from 0.75 V s/rad on it is unstable.
DECK = """
arm one {
    link bar { mass = 6 kg;  shape = rod(length = 0.6 m, along = x); }
    joint turn revolute { parent = base;  child = bar;  axis = z; }
}
servo geared {
    model = compliant_gearbox;  ratio = 100;  stiffness = 8000 N*m/rad;  damping = 8 N*m*s/rad;
    kp = 0.05 V*s/rad;  ki = 0.5 V/rad;  k_position = 6 1/s;  v_max = 48 V;
    resistance = 1.2 ohm;  kt = 0.08 N*m/A;  tau_max = 3 N*m;  j_m = 1.5e-4 kg*m^2;
    sensor qd = tachometer { filter = butterworth;  cutoff = 80 Hz;  delay = 1; }
    command = position(0.05 rad);
}
run hold {
    arm = one;  servos { turn = geared; }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }  duration = 0.1 s;  record = [q];
    metric late = final { of = abs(turn.q - 0.05 rad); }
    require late < 1 rad;
}
sweep gains of hold { vary geared.kp = [0.05, 0.1, 0.2, 0.5, 1] V*s/rad; }
tune tuned of hold { choose geared.kp = logbetween(0.05, 1) V*s/rad;  minimise late;  at_most = 40; }
tune firm of hold {
    choose geared.kp = logbetween(0.05, 1) V*s/rad;  minimise late;  at_most = 40;  least_margin = 0.67;
}
tune never of hold {
    choose geared.kp = logbetween(0.05, 1) V*s/rad;  minimise late;  at_most = 40;  least_margin = 1.99;
}
"""


def margins(disk: float) -> LeastMargins:
    """Margins of the loop of joint `turn`."""
    return LeastMargins(disk, 1.9, 0.0023, ("turn",), 1, 0.05, 1, 1, 12)


def planted(disks: dict[int, float], least_margin: float = 0.3) -> BestAnswer:
    """The answer of a sweep of four gains, the least `late` first, of which some designs were judged."""
    kp, late = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.0, 3.0, 4.0])
    column = SimpleNamespace(key="parameter:kp", label="kp", unit="", role="parameter", values=kp)
    variable = SimpleNamespace(path="kp", name="kp", unit="1", attributes={})
    metric = SimpleNamespace(path="late", name="late", unit="1", attributes={})
    pool: Any = SimpleNamespace(
        name="gains", columns=(column,), count=4, groups=(), requirements=("x < 1",), outcomes=np.ones((4, 1), np.int8),
        variables=lambda role: [variable] if role == "coordinate" else [metric], metrics=list,
        gathered=lambda name: {"kp": kp, "late": late}[name],
    )  # fmt: skip
    designs = Designs(pool)
    judged = {number: JudgedDesign(number, margins(disk)) for number, disk in disks.items()}
    goals = [designs.goal("late")]
    return BestAnswer(designs, goals, (), deck="d.ic", name="gains", seed=0, judged=judged, least_margin=least_margin)


SAID = "(1.857 times the gain or 33.4 deg), gain margin 1.9, delay margin 2.3 ms: the loop of joint `turn` in case #1"


def test_a_design_that_keeps_the_margin_is_used_and_a_better_one_that_does_not_is_named() -> None:
    answer = planted({0: 0.0, 1: 0.2, 2: 0.6})
    assert (answer.best, answer.left, answer.advised) == (2, 0, True)
    assert answer.headline == "use kp = 3"
    first, usual, better = answer.stability()
    assert first.startswith(f"stability: disk margin 0.6 {SAID}") and usual.startswith("less than usual")
    better = better.replace("\N{NO-BREAK SPACE}", " ")
    assert better == "better, and not advised: kp = 1, the loop of joint `turn` is unstable in case #1 at 0.05 s"
    assert [(row.design, row.label) for row in answer.rows()] == [
        (2, "keeps the margin"), (0, "least late"), (1, "not advised"), (3, "4th")
    ]  # fmt: skip


def test_where_no_design_keeps_the_margin_the_best_is_not_advised() -> None:
    answer = planted({0: 0.25, 1: 0.2})
    assert (answer.best, answer.left, answer.advised) == (0, None, False)
    assert answer.headline == "not advised: kp = 1"
    assert answer.stability()[-1] == "none of the 2 designs that were judged keeps the least margin of 0.3"
    assert planted({0: 0.25}).stability()[-1] == "it does not keep the least margin of 0.3"


def test_where_stability_is_not_judged_the_best_is_used_and_it_is_said() -> None:
    answer = planted({}, 0.0)
    assert (answer.best, answer.advised, answer.headline) == (0, True, "use kp = 1")
    assert answer.stability() == ["stability not judged: the least margin that is asked for is 0"]


# A tuning's answer, of an archive in which judgements are planted


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a tuning whose joint has no servo."""
    deck = swing("metric far = final { of = slide.q; }", "require far > -0.05 m;", record="")
    deck += (
        "tune still of swing { choose environment.held.stiffness = between(2, 9) N/m;  maximise far;  at_most = 12; }"
    )
    folder = tmp_path_factory.mktemp("judged")
    return batch.run(ic.compile(text=deck, select=["still"]), output=folder / "a.h5", threads=1).path


Planted = Callable[..., tuple[list[str], dict[str, Any], bool, str]]


@pytest.fixture
def answered(archive: Path, tmp_path: Path) -> Planted:
    """Plants judged designs, by the places of their cases in the order of their worth, and says the answer: its lines,
    its data, whether it is good, and the report's words."""
    import h5py

    def answer(*designs: JudgedDesign, **attributes: Any) -> tuple[list[str], dict[str, Any], bool, str]:
        (tmp_path / "a.h5").write_bytes(archive.read_bytes())
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            held = file.attrs
            held["search_judged"] = json.dumps(encode(tuple[JudgedDesign, ...], designs))
            for name, value in attributes.items():
                if value is None:
                    del held[name]
                else:
                    held[name] = value
        with ArchiveFile(tmp_path / "a.h5") as file:
            found = SearchAnswer.of(file.groups[0])
            reported = search_answer(file, file.groups[0])
            assert found is not None and reported is not None
            verdict = answer_outcome(found).headline
            return found.lines(), found.as_data(), found.ok, f"{reported.headline}. {reported.why}. {verdict}."

    return answer


def test_a_tuning_uses_the_best_that_keeps_the_margin_and_names_the_one_that_it_left(answered: Planted) -> None:
    lines, data, ok, report = answered(JudgedDesign(3, margins(0.1)), JudgedDesign(5, margins(0.6)))
    assert ok and lines[0].startswith("use ") and data["serves"]
    text = " ".join(line.strip() for line in lines)
    assert f"stability: disk margin 0.6 {SAID} at 0.05 s, the least of 1 loop in 1 case at 12 poses" in text
    assert "which is not advised: disk margin 0.1 (1.105 times the gain or 5.72 deg)" in text
    assert (data["stability"]["disk"], data["least_margin"], data["stability_not_judged"]) == (0.6, 0.3, None)
    assert "delay margin 2.3 ms: the loop of joint `turn` in case #1 at 0.05 s" in report


def test_a_tuning_none_of_whose_designs_keeps_the_margin_advises_none(answered: Planted) -> None:
    lines, data, ok, report = answered(JudgedDesign(3, margins(0.1)), JudgedDesign(5, margins(0.2)))
    text = " ".join(line.strip() for line in lines)
    assert not ok and lines[0].startswith("not advised: ") and not data["serves"]
    assert "disk margin 0.1" in text and data["stability"]["disk"] == 0.1
    assert (
        "none of the 2 designs that were judged keeps the least margin of 0.3; with `least_margin = 0.3;` in the "
        "tuning it looks for one that does"
    ) in text
    assert report.startswith("Not advised: ")
    assert report.endswith("The answer meets all requirements, but its disk margin of 0.1 is below the least, 0.3.")
    lines, *_ = answered(JudgedDesign(3, margins(0.1)), search_least_margin=0.5, search_steers=1)
    assert "  it does not keep the least margin of 0.5" in lines


def test_a_tuning_without_margins_is_used_and_the_reason_said(answered: Planted) -> None:
    lines, data, ok, _ = answered(JudgedDesign(3, None, "the law of joint `turn` is continuous"))
    assert ok and lines[0].startswith("use ")
    assert "  stability not judged: the law of joint `turn` is continuous" in lines
    assert (data["stability"], data["stability_not_judged"]) == (None, "the law of joint `turn` is continuous")
    lines, _, ok, _ = answered(search_least_margin=0.0)
    assert ok and "  stability not judged: the least margin that is asked for is 0" in lines


def test_an_archive_of_a_tuning_from_before_says_so(answered: Planted) -> None:
    nothing = dict.fromkeys(("search_least_margin", "search_steers"))
    lines, data, ok, _ = answered(**nothing, search_judged=None)
    assert ok and lines[0].startswith("use ") and data["stability"] is None
    assert "  stability not judged: this archive was made before MET judged it; run it again" in lines


# As run


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck and the archives of its sweep and its tunings."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "d.ic").write_text(DECK, encoding="utf-8")
    for name in ("gains", "tuned", "firm", "never"):
        batch.run(ic.compile(folder / "d.ic", select=[name]), output=folder / f"{name}.h5", threads=1)
    return folder


Said = Callable[[str], tuple[int, str]]


@pytest.fixture
def best(place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Said:
    monkeypatch.chdir(place)

    def call(options: str) -> tuple[int, str]:
        status = main(["best", *shlex.split(options)])
        return status, capsys.readouterr().out

    return call


@pytest.mark.slow
def test_a_sweep_s_design_keeps_the_margin_that_is_asked_for(best: Said) -> None:
    chosen = {}
    for least in ("0", "0.3", "0.67", "1", "1.99"):
        status, out = best(f"gains.h5 --by late --least-margin {least} --format json")
        data = json.loads(out)
        chosen[least] = (status, data["advised"], float(data["best"]["chosen"]["geared.kp"].split()[0]))
        if least != "0":
            assert (data["best"]["stability"]["disk"] >= float(least)) == data["advised"] == (status == 0)
    assert chosen["0"][:2] == (0, True) and chosen["1.99"][:2] == (1, False)
    assert chosen["0"][2] == chosen["1.99"][2] == pytest.approx(1.0)
    assert chosen["0"][2] > chosen["0.3"][2] >= chosen["0.67"][2] >= chosen["1"][2]
    _, out = best("gains.h5 --by late")
    assert "better, and not advised: geared.kp = 1 V*s/rad, the loop of joint `turn` is unstable" in " ".join(
        out.split()
    )


@pytest.mark.slow
@pytest.mark.parametrize("least", ["nan", "-1", "2", "1e308", "inf", "much"])
def test_a_least_margin_that_is_none_is_refused(best: Said, least: str) -> None:
    assert best(f"gains.h5 --by late --least-margin {least}")[0] == 2
    assert best("tuned.h5 --least-margin 0.5")[0] == 2


@pytest.mark.slow
def test_no_design_that_is_not_advised_is_written_into_a_deck(best: Said, place: Path) -> None:
    status, out = best("gains.h5 --by late --least-margin 1.99 --write")
    assert status == 1 and out.endswith("no design is advised, so nothing is written into the deck\n")
    assert (place / "d.ic").read_text(encoding="utf-8") == DECK


@pytest.mark.slow
def test_the_report_names_the_design_that_keeps_the_margin(place: Path) -> None:
    with ArchiveFile(place / "gains.h5") as file:
        found = design_answer(file, Pool("gains", list(file.groups)))
    assert found is not None and found.headline.startswith("Use geared.kp = ")
    assert any(note.startswith("Stability: disk margin ") for note in found.notes)


@pytest.mark.slow
def test_a_tuning_is_stable_and_one_with_a_margin_keeps_it(best: Said) -> None:
    tuned, firm = (json.loads(best(f"{name}.h5 --format json")[1]) for name in ("tuned", "firm"))
    assert tuned["stability"]["disk"] >= 0.3 and tuned["least_margin"] == 0.3
    assert firm["stability"]["disk"] >= 0.67 and firm["least_margin"] == 0.67
    assert firm["value"] >= tuned["value"]
    assert tuned["stability"]["gain"] >= (1.0 + 0.5 * 0.3) / (1.0 - 0.5 * 0.3) and math.isfinite(tuned["value"])


@pytest.mark.slow
def test_a_margin_that_no_candidate_keeps_advises_none(best: Said) -> None:
    status, text = best("never.h5")
    assert status == 1 and text.startswith("not advised: ")
    assert " the least margin of 1.99" in text
