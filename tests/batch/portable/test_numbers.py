"""`met view ARCHIVE --numbers DECK`: numbers of the deck are dragged on the page, by a second module."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from batch.portable.numbers import limits, varied
from ic.driver.given_values import given_run
from met import cli
from met.run import prepare, run
from tests.batch.portable.test_view import SAID, Chromium, chromium, quiet  # noqa: F401 - a fixture

DECK = """\
#include <two_link.ic>
run brief like nominal { duration = 2 s; remove settle; require volts < 3.55 V; }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("numbers")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    words = ["run", folder / "deck.ic", "brief", "-q", "--no-picture", "-o", folder / "a.h5"]
    assert cli.main([str(word) for word in words]) in (cli.YES, cli.NO)
    assert cli.main(["view", str(folder / "a.h5"), "-q", "--numbers", str(folder / "deck.ic")]) == 0
    return folder


def test_limits_are_where_the_deck_is_refused(folder: Path) -> None:
    made = varied(given_run(folder / "deck.ic", "brief"))
    found = dict(zip((each.path for each in made.experiment.cases.coordinates), limits(made), strict=True))
    mass = found["links.upper.mass"]
    assert mass["low"] == 0.0 and mass["below"] == "`mass` of link `upper` must be at least 0 kg"
    assert mass["high"] == 40.0 * 1001.0 and mass["above"] == "it is more than 1000 times as far as the deck's"
    assert found["shoulder.servo.kp"]["low"] <= 0.0 < found["shoulder.servo.kp"]["high"]


def test_another_deck_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "other.ic").write_text(DECK.replace("3.55", "3.6"), encoding="utf-8")
    assert cli.main(["view", str(folder / "a.h5"), "--numbers", str(tmp_path / "other.ic")]) == 2
    assert capsys.readouterr().err == (
        f"error[E479]: {tmp_path / 'other.ic'} is not the deck that the archive was made with, or includes other "
        "files\n = help: run it again, and view the new archive\n\n1 error\n"
    )


SWITCH = "document.querySelector('.other-numbers').click()"
CHOOSE = """(path => { const e = document.querySelector('.knob select');
    e.value = [...e.options].find(o => o.textContent === path).value; e.dispatchEvent(new Event('change')); })"""
TYPE = """(value => { const e = document.querySelector('.knob input[type=number]'); e.value = value;
    e.dispatchEvent(new Event('change')); return document.querySelector('.answers').innerText; })"""
METRIC = """(() => { const { data, values } = MET.page, told = data.description;
    const kernel = METKernel.make(Uint8Array.from(atob(data.module), c => c.charCodeAt(0)), told.kernel);
    return String(new BigInt64Array(kernel.run([values()], told.ticks).outputs.buffer)[told.metrics[0].output]); })()"""


@pytest.mark.browser
def test_a_dragged_number_gives_the_bits_of_vary_and_turns_the_verdict(
    chromium: Chromium,  # noqa: F811
    folder: Path,
) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    assert page.run(SAID).startswith("Case #0, with the archive's bits")
    page.run(SWITCH)
    assert page.run(SAID).startswith("Another structure than the archive's, whose bits may differ in the last digits: ")
    page.run(f"{CHOOSE}('shoulder.servo.kp')")
    said = {value: page.run(f"{TYPE}({value})").split(": ")[-1] for value in (0.005, 0.02)}
    assert sorted(said.values()) == ["met", "missed"]
    page.run(f"{TYPE}(0.005)")
    bits = int(page.run(METRIC))

    made = varied(given_run(folder / "deck.ic", "brief"))
    cases = made.experiment.cases
    from dataclasses import replace

    moved = tuple(
        replace(each, values=np.array([0.005])) if each.path == "shoulder.servo.kp" else each
        for each in cases.coordinates
    )
    native = run(prepare(replace(made.experiment, cases=replace(cases, coordinates=moved)))).metrics["volts"]
    assert bits == int(native.view("int64")[0])
    words = ["run", "deck.ic", "brief", "-q", "--no-picture", "--set", "shoulder.servo.kp=0.005 V*s/rad", "-o", "s.h5"]
    assert cli.main([str(folder / each) if each.endswith((".ic", ".h5")) else each for each in words]) in (0, 1)
    with xarray.open_dataset(folder / "s.h5") as data:
        assert float(native[0]) == pytest.approx(
            float(data["volts"].item()), rel=1e-12
        )  # folded constants round otherwise

    page.run(f"{CHOOSE}('links.upper.mass')")
    page.run(f"{TYPE}(-1)")
    assert page.run("document.querySelector('[role=alert]').textContent") == (
        "-1 kg is refused: `mass` of link `upper` must be at least 0 kg"
    )
    page.settle()
    page.picture(folder / "numbers.png")
    page.run(SWITCH)
    assert page.run(SAID).startswith("Case #0, with the archive's bits")
    quiet(page)
    page.close()
