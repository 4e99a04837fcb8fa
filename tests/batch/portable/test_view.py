"""`met view`: a page whose sliders run the archive's cases again, in a browser, with the archive's bits."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from batch.archive.read import ArchiveFile
from batch.portable import page as portable_page
from met import cli
from tests.batch.report.browser import INK, Chromium, browser_or_skip, quiet

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;
    remove settle;
    require volts < 3.55 V;
}
sweep tuned of brief { vary gearbox.kp = [0.005, 0.01, 0.02] V*s/rad; vary links.upper.mass = [45000, 90000] g; }
sweep ways of brief { vary integrator = [modified_euler, rk4]; }
"""


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a page, its archive, and an archive of two groups."""
    folder = tmp_path_factory.mktemp("sent")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    for name in ("tuned", "ways"):
        words = ["run", folder / "deck.ic", name, "-q", "--no-picture", "-o", folder / f"{name}.h5"]
        assert cli.main([str(word) for word in words]) in (cli.YES, cli.NO)
    assert cli.main(["view", str(folder / "tuned.h5"), "-q"]) == 0
    return folder


@pytest.mark.release
def test_a_page_is_whole_and_allows_itself_one_script_and_webassembly(sent: Path) -> None:
    page = (sent / "tuned.view.html").read_text(encoding="utf-8")
    rules = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert rules is not None
    digest = r"'sha256-[\w+/=]{44}'"
    expected = (
        rf"default-src 'none'; script-src {digest} 'wasm-unsafe-eval'; style-src {digest}; img-src data:; "
        r"base-uri 'none'; form-action 'none'"
    )
    assert re.fullmatch(expected, rules[1])
    assert page.count("<script") == 1 and not re.search(
        r"https?://(?!www\.w3\.org/2000/svg)[\w.]+/", page.split("<script>")[0]
    )
    again = sent / "again.html"
    assert cli.main(["view", str(sent / "tuned.h5"), "-q", "-o", str(again)]) == 0
    assert again.read_text(encoding="utf-8") == page


@pytest.mark.slow
def test_pages_are_refused_before_anything_is_computed(
    sent: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(sent)
    (sent / "mine.html").write_text("<p>mine")
    for output, said in (
        ("mine.html", "error[E474]: mine.html exists and was not written by `met view`: it is not written over\n"),
        ("view.pdf", "error[E475]: cannot write view.pdf: pages are HTML files\n = help: `-o view.html`\n"),
    ):
        assert cli.main(["view", "tuned.h5", "-o", output]) == 2
        assert said in capsys.readouterr().err
    assert cli.main(["view", "ways.h5"]) == 2
    assert capsys.readouterr().err.startswith(
        "error[E473]: a page is of one run or sweep, and ways.h5 has 2\n"
        " = help: name one: ways.modified_euler, ways.rk4\n"
    )
    assert cli.main(["view", "ways.h5", "ways.rk4", "-q", "-o", "rk4.html"]) == 0
    assert (sent / "mine.html").read_text() == "<p>mine"


chromium = pytest.fixture(scope="module")(browser_or_skip)


SAID = "document.querySelector('.came').textContent"
CHOOSE = """(n => { const e = document.querySelector('.knob select'); e.value = n; e.dispatchEvent(new Event('change'));
    return document.querySelector('.came').textContent; })"""
MOVE = """((n, at) => { const e = document.querySelectorAll('.knob input[type=range]')[n]; e.value = at;
    e.dispatchEvent(new Event('input')); return document.querySelector('.came').textContent; })"""


@pytest.mark.browser
def test_each_case_has_the_archives_bits_and_says_so(chromium: Chromium, sent: Path) -> None:
    page = chromium.open(sent / "tuned.view.html")
    page.settle()
    for n in range(6):
        assert page.run(f"{CHOOSE}({n})").startswith(
            f"Case #{n}, with the archive's bits in its metric: computed here in "
        )
    assert all(share > 0.005 for share in page.run(f"{INK}('.panel canvas')"))
    quiet(page)
    page.close()


@pytest.mark.release
@pytest.mark.browser
@pytest.mark.parametrize("machine", ["false", "METKernel.fuses()"])
def test_every_recorded_number_in_the_browser_has_the_archives_bits(
    chromium: Chromium, sent: Path, machine: str
) -> None:
    page = chromium.open(sent / "tuned.view.html")
    found = page.run(f"""(() => {{
        const told = MET_PAGE.description, code = Uint8Array.from(atob(MET_PAGE.module), c => c.charCodeAt(0));
        const kernel = METKernel.make(code, told.kernel, {machine});
        const {{ rows }} = kernel.run(told.cases.inputs, told.ticks);
        return {{ columns: told.columns, rows: told.rows, bits: Array.from(new BigInt64Array(rows.buffer), String) }};
    }})()""")
    with xarray.open_dataset(sent / "tuned.h5") as data:
        count = 0
        for n, column in enumerate(found["columns"]):
            joint = column["channel"].removesuffix(f".{column['signal']}")
            values = (
                data[column["signal"]].sel(joint=joint).values
                if "joint" in data[column["signal"]].dims
                else data[column["signal"]].values
            )
            bits = [str(b) for b in values.reshape(-1).view("int64").tolist()]
            assert found["bits"][n :: len(found["columns"])] == bits, column
            count += len(bits)
    assert count == len(found["bits"]) == 6 * found["rows"] * len(found["columns"])
    page.close()


@pytest.mark.browser
def test_a_slider_runs_the_case_again_and_turns_the_verdict(chromium: Chromium, sent: Path) -> None:
    page = chromium.open(f"{(sent / 'tuned.view.html').resolve().as_uri()}#case=0")
    page.settle()
    before = page.picture(sent / "before.png").read_bytes()
    assert page.run("document.querySelector('.answers .met, .answers .missed').className") == "missed"
    assert page.run(f"{MOVE}(0, 0.93)").startswith("Not in the archive: computed here in ")
    assert page.run("document.querySelector('.knob select').value") == ""
    assert page.run("document.querySelector('.answers .met, .answers .missed').className") == "met"
    page.settle()
    assert page.picture(sent / "after.png").read_bytes() != before
    assert page.run(f"{MOVE}(0, 0.995)").startswith("Case #4, with the archive's bits")  # near what the archive has
    typed = "document.querySelectorAll('.knob .typed')[{0}]"
    assert page.run(f"{typed.format(1)}.querySelector('input').value") == "45000"
    assert page.run(f"{typed.format(1)}.innerText").strip() == "g"
    give = """((text) => { const e = document.querySelector('.knob .typed input'); e.value = text;
        e.dispatchEvent(new Event('change'));  return document.querySelector('[role=alert]').textContent; })"""
    assert page.run(f"{give}('0.01')") == "" and page.run(SAID).startswith("Case #2, with the archive's bits")
    assert page.run(f"{give}('0.012')") == "" and page.run("MET.page.values()[0]") == pytest.approx(0.012, rel=1e-12)
    assert page.run(f"{give}('0.021')") == (
        "0.021 V·s/rad is beyond what the sweep has: from 0.005 V·s/rad to 0.02 V·s/rad"
    )
    assert page.run(f"{give}('much')") == "much is no number" and page.run("MET.page.values()[0]") != 0.021
    page.run(f"{CHOOSE}(0)")
    page.run("document.querySelector('.knob input[type=range]').focus()")
    seen = []
    for _ in range(3):  # each press is seen, also at a case, which holds the slider when it is dragged
        page.key("ArrowRight")
        seen.append(page.run("MET.page.values()[0]"))
    assert 0.005 < seen[0] < seen[1] < seen[2]
    quiet(page)
    page.close()


@pytest.mark.browser
def test_the_list_of_cases_says_values_misses_the_best_and_the_worst(chromium: Chromium, sent: Path) -> None:
    page = chromium.open(sent / "tuned.view.html")
    page.settle()
    with xarray.open_dataset(sent / "tuned.h5") as data:
        volts = data["volts"].values
        names = [
            f"#{n} {kp:g} V·s/rad, {1000 * mass:g} g"
            for n, (kp, mass) in enumerate(zip(data["gearbox.kp"].values, data["links.upper.mass"].values, strict=True))
        ]
    words = ["misses volts < 3.55 V" if value >= 3.55 else "" for value in volts]
    ranks = {int(volts.argmin()): " (best)", int(volts.argmax()): " (worst)"}
    assert 0 < sum(map(bool, words)) < len(words)
    expected = [
        f"{name} {f'✗ {word}' if word else '✓'}{ranks.get(n, '')}"
        for n, (name, word) in enumerate(zip(names, words, strict=True))
    ]
    options = page.run("[...document.querySelectorAll('.knob option')].map(e => e.textContent.replace(/\\s+/g, ' '))")
    assert options[1:] == expected
    assert "met report tuned.h5" in page.run("document.querySelector('main').innerText")
    page.close()


@pytest.mark.browser
def test_it_opens_on_the_worst_case_of_the_design_to_use(chromium: Chromium, sent: Path) -> None:
    with xarray.open_dataset(sent / "tuned.h5") as data:
        volts, gains = data["volts"].values, data["gearbox.kp"].values
    page = chromium.open(sent / "tuned.view.html")
    page.settle()
    opens = page.run("MET_PAGE.opens")
    own = volts[gains == gains[opens]]
    assert len(own) == 2 and own.max() == volts[opens] < 3.55 < volts.max()
    assert page.run("MET.page.values()") == page.run("MET_PAGE.description.cases.inputs[MET_PAGE.opens]")
    quiet(page)
    page.close()


@pytest.mark.browser
def test_the_address_keeps_the_case_and_the_sliders(chromium: Chromium, sent: Path) -> None:
    page = chromium.open(sent / "tuned.view.html")
    page.settle()
    wait = "new Promise(done => setTimeout(() => done(location.hash), 500))"
    assert page.run(wait) == ""
    page.run(f"{CHOOSE}(3)")
    assert page.run(wait) == "#case=3"
    page.run(f"{MOVE}(0, 0.5)")
    between, values = page.run(wait), page.run("MET.page.values()")
    assert between == f"#at={','.join(map(str, values))}".replace(".0,", ",").removesuffix(".0")
    page.close()
    start = (sent / "tuned.view.html").resolve().as_uri()
    for hash_, expected in (
        ("#case=3", "cases.inputs[3]"),
        (between, json.dumps(values)),
        ("#case=99", "cases.inputs[MET_PAGE.opens]"),
        ("#at=1e300,1", "cases.inputs[MET_PAGE.opens]"),
        ("#at=<b>", "cases.inputs[MET_PAGE.opens]"),
    ):
        page = chromium.open(start + hash_)
        page.settle()
        wanted = page.run(f"(({{ cases }}) => {expected})(MET_PAGE.description)")
        assert page.run("MET.page.values()") == wanted, hash_
        quiet(page)
        page.close()


@pytest.mark.browser
def test_an_archive_that_holds_other_numbers_is_told_apart(chromium: Chromium, sent: Path, tmp_path: Path) -> None:
    text = (sent / "tuned.view.html").read_text(encoding="utf-8")
    changed = re.sub(r'"metrics":\["[^"]{8}', lambda found: found[0][:-8] + "AAAAAAAA", text)
    assert changed != text
    loose = re.sub(r"script-src '[^']*'", "script-src 'unsafe-inline'", changed)
    (tmp_path / "changed.html").write_text(loose, encoding="utf-8")
    page = chromium.open(f"{(tmp_path / 'changed.html').resolve().as_uri()}#case=0")
    assert page.run(SAID).startswith("Other numbers than the archive has for case #0 (volts): ")
    page.close()
    (tmp_path / "unsigned.html").write_text(changed, encoding="utf-8")
    page = chromium.open(tmp_path / "unsigned.html")
    assert page.run("document.querySelector('.came')") is None  # no script runs that is not the page's own
    page.close()


MARGINS = """\
#include <two_link.ic>
run held like nominal {
    duration = 0.4 s;  remove settle;
    linear loop { at = 360 ms;  open = shoulder.servo.voltage; }
    require gain_margin(loop) > 20;
}
sweep tuned of held { vary gearbox.kp = [0.005, 0.02] V*s/rad; }
"""


@pytest.mark.release
@pytest.mark.browser
def test_a_margin_is_shown_as_the_archive_has_it_and_is_not_known_elsewhere(chromium: Chromium, tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(MARGINS, encoding="utf-8")
    archive = tmp_path / "a.h5"
    assert cli.main(["run", str(tmp_path / "deck.ic"), "tuned", "-q", "--no-picture", "-o", str(archive)]) == cli.NO
    assert cli.main(["view", str(archive), "-q"]) == 0
    with xarray.open_dataset(archive) as data:
        margins = data["loop_gain_margin"].values.tolist()
    assert margins[0] > 20.0 > margins[1]
    page = chromium.open(tmp_path / "a.view.html")
    page.settle()
    row = "document.querySelector('.answers tr:last-child').innerText"
    for case, verdict in enumerate(("met", "missed")):
        page.run(f"{CHOOSE}({case})")
        name, value, about, told = page.run(row).split("\t")
        assert name.strip() == "loop_gain_margin" and value.strip().endswith(", from the archive")
        assert float(value.partition(",")[0]) == pytest.approx(margins[case], rel=1e-3)
        assert about.strip() == "gain_margin of loop"
        assert told.strip().startswith(f"gain_margin(loop) > 20: {verdict}")
    assert page.run(f"{MOVE}(0, 0.5)").startswith("Not in the archive: ")
    assert [cell.strip() for cell in page.run(row).split("\t")] == [
        "loop_gain_margin", "not computed here", "gain_margin of loop", "gain_margin(loop) > 20: not known",
    ]  # fmt: skip
    quiet(page)
    page.close()


RUNAWAY = """\
arm rail {
    link cart { mass = 1 kg; shape = box(size = [0.1, 0.1, 0.1] m); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
}
run it {
    arm = rail;  initial { slide.qd = 1 m/s; }
    environment { drag = joint_damping { sliding = 50 N*s/m; } }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 3200 ms;
    record = [qd];  metric late = final { of = slide.qd; }  require late < 1 m/s;
}
sweep damped of it { vary environment.drag.sliding = [50, 220] N*s/m; }
"""


@pytest.mark.browser
def test_a_case_that_runs_away_fails_in_the_page_as_in_the_archive(chromium: Chromium, tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(RUNAWAY, encoding="utf-8")
    archive = tmp_path / "a.h5"
    assert cli.main(["run", str(tmp_path / "deck.ic"), "damped", "-q", "--no-picture", "-o", str(archive)]) == cli.NO
    assert cli.main(["view", str(archive), "-q"]) == 0
    with xarray.open_dataset(archive) as data:
        valid = data["n_valid"].values.tolist()
    page = chromium.open(tmp_path / "a.view.html")
    page.settle()
    assert page.run(SAID).startswith("Case #0, with the archive's bits in its metric: ")
    said = page.run(f"{CHOOSE}(1)")
    assert said.startswith("Case #1 fails, as in the archive: ")
    assert said.endswith(f"; it fails at {valid[1] / 100:g} s.") and valid[1] < valid[0]
    answer = page.run("document.querySelector('.answers').innerText")
    assert "no value" in answer and answer.endswith("late < 1 m/s: not known")
    quiet(page)
    page.close()


UNITS = """\
arm crane {
    link cart { mass = 1 kg; shape = box(size = [0.1, 0.1, 0.1] m); }
    link boom { mass = 1 kg; shape = cylinder(radius = 2 cm, length = 0.5 m, along = x); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
    joint turn  revolute  { parent = cart; child = boom; axis = z; }
}
run it {
    arm = crane;  initial { slide.qd = 0.5 m/s;  turn.q = -20 deg; }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 1 s;  record = [q];
    metric far = final { of = slide.q; }   require far < 70 cm;
    metric low = min   { of = turn.q; }    require low > -30 deg;
}
sweep cranes of it { vary links.cart.mass = [900, 2000] g; }
"""

PLOTTED = """(() => { const made = uPlot, seen = [];
    uPlot = function (options, data, frame) { seen.push(data); return new made(options, data, frame); };
    dispatchEvent(new Event('resize'));  uPlot = made;
    return seen.map(data => data.slice(1).map(line => Array.from(line))); })()"""


@pytest.mark.browser
def test_numbers_are_in_the_decks_units_and_a_signal_of_two_has_two_plots(chromium: Chromium, tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(UNITS, encoding="utf-8")
    archive = tmp_path / "a.h5"
    assert cli.main(["run", str(tmp_path / "deck.ic"), "cranes", "-q", "--no-picture", "-o", str(archive)]) == cli.YES
    assert cli.main(["view", str(archive), "-q"]) == 0
    page = chromium.open(tmp_path / "a.view.html")
    page.settle()
    with xarray.open_dataset(archive) as data:
        metrics = [100.0 * float(data["far"][1]), float(np.degrees(data["low"][1]))]
        slide, turn = (data["q"].isel(recorded_case=1).sel(joint=joint).values for joint in ("slide", "turn"))
    page.run(f"{CHOOSE}(1)")
    cells = page.run("Array.from(document.querySelectorAll('.answers tr'), e => e.cells[1].innerText.split(' '))")
    assert [unit for _, unit in cells] == ["cm", "deg"]
    assert [float(value) for value, _ in cells] == pytest.approx(metrics, rel=1e-3)
    heads = page.run("Array.from(document.querySelectorAll('.panel .head'), e => e.innerText.replace(/\\s+/g, ' '))")
    assert heads == ["q (cm) joint position t = 0 s", "q (deg) joint position t = 0 s"]
    assert page.run("[...document.querySelectorAll('.lines')].map(e => e.innerText.replace(/\\s+/g, ' ').trim())") == [
        "slide 0",
        "turn -20",
    ]
    lines = [panel[0] for panel in page.run(PLOTTED)]
    assert lines[0] == pytest.approx((100.0 * slide).tolist(), rel=1e-12)
    assert lines[1] == pytest.approx(np.degrees(turn).tolist(), rel=1e-12)
    quiet(page)
    page.close()


@pytest.mark.slow
def test_an_archive_without_a_metric_of_its_plan_is_damaged(
    sent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(sent / "tuned.h5", tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["volts"]
    assert cli.main(["view", str(tmp_path / "a.h5")]) == 2
    assert "error[E302]: the archive " in capsys.readouterr().err


HOSTILE = "</script><img src=x onerror=\"document.title='hurt'\">\u202e"


@pytest.mark.browser
def test_texts_of_an_archive_are_texts_whatever_they_hold(chromium: Chromium, sent: Path, tmp_path: Path) -> None:
    with ArchiveFile(sent / "tuned.h5") as file:
        experiment = file.plan().experiments[0]
        data = portable_page.data_of(experiment, file, file.groups[0])
    assert data["same_code"] and "by the code that the archive was made with" in portable_page.page_of(experiment, data)
    data["same_code"] = False
    data["arm"]["scene"]["bodies"] = [[HOSTILE, carrier] for _, carrier in data["arm"]["scene"]["bodies"]]
    data["labels"] = data["units"] = data["metricUnits"] = data["columnUnits"] = [HOSTILE] * 9
    for key in ("inputs", "columns", "metrics", "requirements"):
        for each in data["description"][key]:
            each.update({name: HOSTILE for name in ("name", "channel", "signal", "metric", "text") if name in each})
    text = portable_page.page_of(replace(experiment, name=HOSTILE), data)
    assert portable_page.OTHER_CODE in text
    (tmp_path / "hostile.html").write_text(text, encoding="utf-8")
    page = chromium.open(tmp_path / "hostile.html")
    page.settle()
    assert "onerror" in page.run("document.querySelector('main').innerText")
    assert "\\u202e" in page.run("document.title") and "onerror" in page.run("document.querySelector('h1').innerText")
    assert page.run("document.querySelectorAll('img').length") == 0
    quiet(page)
    page.close()


@pytest.mark.release
@pytest.mark.browser
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_is_wider_than_a_phone(chromium: Chromium, sent: Path, dark: bool) -> None:
    page = chromium.open(sent / "tuned.view.html", width=400, dark=dark)
    page.settle()
    assert page.run("document.documentElement.scrollWidth") <= 400
    assert json.dumps(page.said) == "[]"
    page.close()
