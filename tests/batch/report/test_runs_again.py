"""A report that runs cases again where it is read: what is in it for that, and the same bits in a browser."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from matplotlib import image

import batch
from batch.archive.read import ArchiveFile
from batch.report import report
from batch.report.contents import simulation
from batch.report.contents.against import ComparedArchive
from batch.report.contents.gathering import gather
from batch.report.contents.parts import Report
from batch.report.html.page import page as html_page
from batch.report.html.payload import exact
from met import cli
from met.messages.visible import visible
from met.run import inputs
from tests.batch.report import archives
from tests.batch.report.archives import HOSTILE
from tests.batch.report.browser import GATHERED, INK, Chromium, Page, quiet
from tests.batch.report.test_page import hostile

VISIBLE = visible(HOSTILE)

DECK = """
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;  remove settle;  require volts < 3.55 V;
    initial { elbow.q = 40 deg; }
}
sweep ways of brief { vary integrator = [modified_euler, rk4];  vary gearbox.kp = [0.005, 0.01, 0.02] V*s/rad; }
sweep many of brief { vary gearbox.kp = linspace(0.005, 0.02, 8) V*s/rad; }
run blind like brief { record = [qd]; }
run shoved like brief {
    record += [reaction.force];
    environment { shove = wrench { link = upper; force = [0, 3, 0] N; from = 0.5 s; } }
}
sweep shoves of shoved { vary environment.shove.force.y = [2, 4] N; }
"""

SAID = "document.querySelector('.computed').textContent"


def gathered(path: Path) -> Report:
    with ArchiveFile(path) as file:
        return gather(file, simulate=True)


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with reports of archives without histories, and these archives."""
    folder = tmp_path_factory.mktemp("again")
    for name in ("ways", "many", "blind", "shoves"):
        batch.run(archives.compiled(folder, name, deck=DECK), output=folder / f"{name}.h5", histories="none")
        report(folder / f"{name}.h5")
    for name, whole in (("ways", "whole"), ("shoves", "shoved")):
        batch.run(archives.compiled(folder, name, deck=DECK), output=folder / f"{whole}.h5", histories="all")
    return folder


class TestWhatIsInIt:
    @pytest.mark.release
    def test_is_each_case_as_it_was_run_and_what_came_of_it(self, sent: Path) -> None:
        found = gathered(sent / "ways.h5").sections[0].simulation
        assert found is not None and found.notes == ()
        with ArchiveFile(sent / "ways.h5") as file:
            experiments = file.plan().experiments
            for each, group, experiment in zip(found.structures, file.groups, experiments, strict=True):
                assert each.same_code and each.arm.lacking == () and each.arm.scene is not None
                rows = np.searchsorted(experiment.cases.table, each.cases)
                assert sorted(each.cases.tolist()) == group.values("case").tolist()
                assert np.array_equal(each.inputs, inputs(experiment, rows))
                [(name, values)] = each.metrics
                positions = np.searchsorted(group.values("case"), each.cases)
                assert name == "volts" and values.tolist() == group.values("volts")[positions].tolist()

    @pytest.mark.slow
    def test_knows_the_column_of_each_line(self, sent: Path) -> None:
        section = gathered(sent / "ways.h5").sections[0]
        assert section.signals is not None and section.simulation is not None
        assert section.signals.histories == () and section.signals.panels[0].unit == "deg"
        for each in section.simulation.structures:
            channels = [column["channel"] for column in each.description["columns"]]
            lines = [[channels[n] for n in columns] for columns in each.panels]
            assert lines[:3] == [[f"{joint}.{name}" for joint in ("shoulder", "elbow")] for name in ("q", "qd", "tau")]

    def test_is_of_fewer_cases_where_they_are_too_many_the_first_of_those_that_are_shown(
        self, sent: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(simulation, "MOST_EXACT", 3 * 8 * 2)  # an input and a metric each
        section = gathered(sent / "many.h5").sections[0]
        assert section.simulation is not None and section.signals is not None
        assert section.simulation.structures[0].cases.tolist() == list(section.signals.first_cases)
        assert section.simulation.notes == ("3 of 8 cases can be run again in this page.",)

    @pytest.mark.slow
    def test_begins_with_the_design_to_use_or_with_the_middle_case(self, sent: Path, compared: Path) -> None:
        many, ways = (gathered(sent / f"{name}.h5").sections[0] for name in ("many", "shoves"))
        assert many.designs is not None and many.signals is not None and many.simulation is not None
        with ArchiveFile(sent / "many.h5") as file:
            met = file.groups[0].values("met")[many.designs.case, 0]
        assert many.signals.opens == many.designs.case != many.signals.first_cases[0] and met == 1
        assert many.signals.opens in many.simulation.structures[0].cases
        assert ways.designs is None and ways.signals is not None and ways.signals.opens == ways.signals.middle
        with ArchiveFile(compared / "b.h5") as file, ArchiveFile(compared / "a.h5") as other:
            before = ComparedArchive(other, batch.diff(compared / "a.h5", compared / "b.h5"))
            [section] = gather(file, against=before, simulate=True).sections
        assert section.signals is not None and section.signals.opens is None, "what changed most comes first"

    @pytest.mark.slow
    def test_is_left_out_where_it_is_not_asked_for(self, sent: Path) -> None:
        source = report(sent / "ways.h5", sent / "without.html", simulate=False).read_text(encoding="utf-8")
        assert "unsafe" not in source and "MET.modules" not in source and "No histories were kept." in source
        words = ["report", str(sent / "ways.h5"), "-o", str(sent / "command.html"), "--no-simulation", "-q"]
        assert cli.main(words) == cli.YES and (sent / "command.html").read_text(encoding="utf-8") == source

    @pytest.mark.slow
    def test_stands_under_the_digest_of_the_page_s_script(self, sent: Path) -> None:
        source = (sent / "ways.html").read_text(encoding="utf-8")
        [rules] = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', source)
        [script] = re.findall(r"<script>(.*?)</script>", source, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        style = r"'sha256-[\w+/=]{44}'"
        expected = (
            rf"default-src 'none'; script-src 'sha256-{re.escape(digest)}' 'wasm-unsafe-eval'; style-src {style}; "
            r"img-src data:; base-uri 'none'; form-action 'none'"
        )
        assert re.fullmatch(expected, rules)
        modules = re.findall(r'"(AGFzb[\w+/=]+)"', script)
        structures = gathered(sent / "ways.h5").sections[0].simulation.structures  # type: ignore[union-attr]
        assert [base64.b64decode(each) for each in modules] == [each.code for each in structures]


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with b.html, the report of b.h5 against a.h5, which has some of its cases, in other places."""
    folder = tmp_path_factory.mktemp("compared")
    earlier = DECK.replace("40 deg", "30 deg").replace("linspace(0.005, 0.02, 8)", "[0.02, 0.3, 0.005]")
    for name, deck in (("a", earlier), ("b", DECK)):
        batch.run(archives.compiled(folder, "many", deck=deck), output=folder / f"{name}.h5", histories="none")
    report(folder / "b.h5", against=folder / "a.h5")
    return folder


@pytest.mark.release
def test_another_archive_s_cases_are_there_under_the_numbers_of_this_one(compared: Path) -> None:
    with ArchiveFile(compared / "b.h5") as file, ArchiveFile(compared / "a.h5") as other:
        before = ComparedArchive(other, batch.diff(compared / "a.h5", compared / "b.h5"))
        found = gather(file, against=before, simulate=True).sections[0].simulation
        assert found is not None
        [now] = found.structures
        assert now.before is not None and now.before.same_code
        both = dict(zip(now.before.cases.tolist(), now.before.inputs.ravel().tolist(), strict=True))
        assert both == {0: 0.005, 7: 0.02}
        was = other.groups[0].values("volts")
        volts = dict(zip(now.before.cases.tolist(), now.before.metrics[0][1].tolist(), strict=True))
        assert volts == {0: was[2], 7: was[0]}


@pytest.mark.parametrize(
    "values", [[0.0, -0.0, 0.0, -0.0], [np.nan, np.inf, 1e-320], [1 / 3] * 9, [1.0 * n for n in range(70_000)]]
)
def test_numbers_are_kept_to_the_bit(values: list[float]) -> None:
    def unpacked(told: dict[str, Any]) -> np.ndarray:
        """As `exact` of simulation.js."""
        each = np.frombuffer(base64.b64decode(told["b"]), "<i8")
        return each[np.frombuffer(base64.b64decode(told["n"]), "<u2")] if "n" in told else each

    given = np.array(values)
    assert unpacked(exact(given)).tolist() == given.view(np.int64).tolist()


def opened(chromium: Chromium, path: Path, **words: Any) -> Page:
    page = chromium.open(path, **words)
    page.settle()
    page.run(GATHERED)
    page.settle()
    return page


@pytest.mark.browser
class TestInTheBrowser:
    @pytest.mark.release
    def test_every_recorded_number_of_every_case_has_the_archive_s_bits(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "ways.html")
        count = 0
        with xarray.open_datatree(sent / "whole.h5") as tree:
            for name in ("ways.modified_euler", "ways.rk4"):
                data = tree[name].to_dataset()
                for place, case in enumerate(data["case"].values.tolist()):
                    found = page.run(f"""(() => {{
                        const {{ numbers, rows }} = MET.models[0].simulation.run({case});
                        return {{ bits: Array.from(new BigInt64Array(numbers.buffer), String), rows }}; }})()""")
                    signals = ("q", "qd", "tau", "shoulder.servo.voltage")
                    parts = [data[each].values[place].reshape(found["rows"], -1) for each in signals]
                    assert found["bits"] == np.concatenate(parts, axis=1).ravel().view(np.int64).astype(str).tolist()
                    count += len(found["bits"])
                    page.run(f"MET.models[0].choose({case})")
                    said = page.run(SAID)
                    assert said.startswith(f"Case #{case} has the archive's bits in its metric: run again here"), said
        assert count == 6 * 51 * 7
        quiet(page)
        page.close()

    def test_the_arm_begins_with_the_design_to_use(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "many.html")
        page.run("dispatchEvent(new Event('beforeprint'))")
        page.settle()
        opens, worst = page.run("(({ opens, shown }) => [opens, shown[0]])(MET.models[0].data.signals)")
        assert opens != worst and page.run(SAID).startswith(f"Case #{opens} has the archive's bits")
        page.close()

    def test_a_case_that_it_cannot_begin_with_is_named(self, chromium: Chromium, sent: Path, tmp_path: Path) -> None:
        text = (sent / "many.html").read_text(encoding="utf-8")
        changed, count = re.subn(r'("opens":)\d+', r"\g<1>99", text)
        assert count == 1
        (tmp_path / "elsewhere.html").write_text(changed, encoding="utf-8")
        page = opened(chromium, tmp_path / "elsewhere.html")
        worst = page.run("MET.models[0].data.signals.shown[0]")
        why = "it is not among those that can be run again in this page"
        assert page.run(SAID).startswith(f"Case #99 would be shown first, but {why}. Case #{worst} has the archive's")
        assert page.run("document.querySelector('.stage .told').textContent") == f"case #{worst}"
        quiet(page)
        page.close()

    def test_another_archive_is_under_it_its_arm_a_ghost(self, chromium: Chromium, compared: Path) -> None:
        page = opened(chromium, compared / "b.html")
        assert page.run("MET.models[0].data.signals.shown[0]") in (0, 7)
        plots = "MET.models[0].signalPlots()"
        assert page.run(f"{plots}.map(u => u.series.length - 1)") == [4, 4, 4, 2]
        assert page.run(f"{plots}[0].data.slice(1).map(line => line[0])") == pytest.approx([0.0, 30.0, 0.0, 40.0])
        assert page.run("[MET.models[0].stage().ghosts(), MET.models[0].stage().isStill()]")[0] == 1
        assert page.run("document.querySelector('.stage .tools .chip:not([hidden])').textContent") == "in a.h5"
        page.run("""(() => { const e = document.querySelector('select.how'); e.value = 'change';
            e.dispatchEvent(new Event('change')); })()""")
        page.settle()
        assert page.run(f"{plots}[0].data.slice(1).map(line => line[0])") == pytest.approx([0.0, 10.0])
        page.run("MET.models[0].choose(3)")  # of which a.h5 has none
        page.settle()
        assert page.run("MET.models[0].stage().ghosts()") == 0
        quiet(page)
        page.close()

    def test_other_numbers_than_the_archive_s_are_told(self, chromium: Chromium, sent: Path, tmp_path: Path) -> None:
        text = (sent / "many.html").read_text(encoding="utf-8")
        changed = re.sub(r'("name":"volts","output":\d+,"values":\{"b":")[^"]{8}', r"\1AAAAAAAA", text)
        assert changed != text
        (tmp_path / "other.html").write_text(changed, encoding="utf-8")
        page = opened(chromium, tmp_path / "other.html")
        first = page.run("MET.models[0].simulation.structures[0].cases[0]")
        page.run(f"MET.models[0].choose({first})")
        assert page.run(SAID).startswith(f"Case #{first} has other numbers here than in the archive in volts: ")
        assert page.run("document.querySelector('.computed').className") == "computed bad"
        page.close()

    def test_any_case_s_signals_are_drawn_by_its_number(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "many.html")
        assert all(share > 0.005 for share in page.run(f"{INK}('.signals.plot canvas')"))
        page.run("""(() => { const e = document.querySelector('input.any'); e.value = '#5';
            e.dispatchEvent(new Event('change')); })()""")
        page.settle()
        assert page.run("document.querySelector('.signals.plot .chip').textContent").startswith("#5")
        assert page.run("document.querySelector('.stage .told').textContent") == "case #5"
        degrees = page.run("MET.models[0].signalPlots()[0].data[2][0]")
        assert degrees == pytest.approx(40.0)
        page.run("""(() => { const e = document.querySelector('input.any'); e.value = '99';
            e.dispatchEvent(new Event('change')); })()""")
        assert page.run("document.querySelector('input.any').validationMessage") == "no case 99 in this page"
        quiet(page)
        page.close()

    def test_arm_and_signals_have_one_clock(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "many.html")
        left, top, width, height = page.box(".signals .u-over")
        page.mouse("mouseMoved", left + 0.75 * width, top + 0.5 * height)
        page.settle()
        assert page.run("MET.models[0].stage().time()") == pytest.approx(1.5, abs=0.05)
        page.mouse("mouseMoved", 1, 1)
        page.run("MET.models[0].stage().seek(0.5)")
        page.settle()
        places = "Array.from(document.querySelectorAll('.signals .u-cursor-x'), e => e.getBoundingClientRect().left)"
        left = page.run("document.querySelector('.signals .u-over').getBoundingClientRect().left")
        assert page.run(places) == pytest.approx([left + 0.25 * width] * 4, abs=3)
        assert page.run("document.querySelector('.reading').textContent").startswith("t 0.48 s")
        quiet(page)
        page.close()

    @pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (400, False), (400, True)])
    def test_the_arm_is_drawn_and_nothing_is_clipped(
        self, chromium: Chromium, sent: Path, tmp_path: Path, width: int, dark: bool
    ) -> None:
        page = opened(chromium, sent / "ways.html", width=width, dark=dark)
        stage = "MET.models[0].stage()"
        assert page.run(f"[{stage}.drawsBy(), {stage}.ghosts()]") == ["webgl", 2]
        assert page.run("document.documentElement.scrollWidth") <= width
        clipped = page.run(CLIPPED)
        assert clipped == [], clipped
        page.run(f"new Promise(d => {{ const f = () => {stage}.isStill() ? d() : setTimeout(f, 20); f(); }})")
        shown = image.imread(page.picture(tmp_path / "view.png", ".stage .view", margin=0))[4:-4, 4:-4, :3]
        colour = shown.max(axis=-1) - shown.min(axis=-1) > 0.25
        assert 0.002 < float(np.mean(colour)) < 0.2 and (shown[-2, shown.shape[1] // 2].mean() < 0.3) == dark
        quiet(page)
        page.close()

    def test_a_case_of_another_structure_has_its_own_arm(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "ways.html")
        for case in (0, 5, 1):
            page.run(f"MET.models[0].choose({case})")
            page.settle()
            told = "Array.from(document.querySelectorAll('.stage')).filter(e => e.offsetParent).map(e => e.innerText)"
            [shown] = page.run(told)
            assert shown.startswith(f"case #{case}\n")
        quiet(page)
        page.close()

    def test_what_acts_on_the_arm_is_drawn_and_its_switch_takes_it_away(self, chromium: Chromium, sent: Path) -> None:
        page = opened(chromium, sent / "shoves.html")
        stage = "MET.models[0].stage()"
        with xarray.open_dataset(sent / "shoved.h5") as data:
            forces = data["reaction.force"].values.reshape(2, -1, 2, 3)
        for case, force in enumerate((2.0, 4.0)):
            page.run(f"MET.models[0].choose({case})")
            page.settle()
            page.run(f"new Promise(d => {{ const f = () => {stage}.legend.looked() ? d() : setTimeout(f, 20); f(); }})")
            for row in (0, 30):
                found = page.run(f"{stage}.legend.reactions({0.04 * row})")
                assert [each[1:] for each in found] == forces[case, row].tolist()
            vectors = [page.run(f"{stage}.legend.now({time}).map(each => each.vector)") for time in (0.3, 1)]
            assert vectors == [[[0, 0, 0], [0, 0, 0]], [[0, force, 0], [0, 0, 0]]]  # no moment
            chips = "Array.from(document.querySelectorAll('.stage .legend .chip:not([hidden])'), e => e.textContent)"
            told = page.run(chips)
            assert told[0].startswith("joint forceslongest ") and told[1] == f"loadslongest {force:g} N"
        page.run(f"{stage}.seek(1)")
        roles = f"{stage}.around().map(each => each.role)"
        assert {"force", "load"} == set(page.run(roles))
        page.run("document.querySelector('.stage .legend .chip.load').click()")
        assert "load" not in page.run(roles)
        quiet(page)
        page.close()

    def test_a_run_that_records_no_position_says_what_to_record(self, chromium: Chromium, sent: Path) -> None:
        page = chromium.open(sent / "blind.html")
        page.run("document.querySelector('.arm').scrollIntoView()")
        page.run(f"new Promise(d => {{ const f = () => {SAID}.trim() ? d() : setTimeout(f, 20); f(); }})")
        said = page.run("document.querySelector('.arm').innerText")
        assert "The arm is not drawn, for the run does not record q: record += [q];" in said
        assert page.run("document.querySelector('.stage')") is None
        quiet(page)
        page.close()

    def test_where_webassembly_is_forbidden_it_says_so_and_shows_the_rest(
        self, chromium: Chromium, sent: Path, tmp_path: Path
    ) -> None:
        text = (sent / "many.html").read_text(encoding="utf-8").replace(" 'wasm-unsafe-eval'", "", 1)
        (tmp_path / "strict.html").write_text(text, encoding="utf-8")
        page = chromium.open(tmp_path / "strict.html")
        page.settle()
        assert page.run("document.documentElement.dataset.ready") == "yes"
        assert "This reader does not run WebAssembly" in page.run("document.querySelector('.arm').innerText")
        assert "no histories, and this reader" in page.run("document.querySelector('.signals.plot').innerText")
        page.close()

    def test_hostile_names_of_what_is_run_again_are_shown_and_not_run(
        self, chromium: Chromium, sent: Path, tmp_path: Path
    ) -> None:
        found = gathered(sent / "ways.h5")
        [section] = found.sections
        assert section.simulation is not None
        one, other = section.simulation.structures
        told = {
            **one.description,
            "metrics": [{**each, "name": HOSTILE} for each in one.description["metrics"]],
            "inputs": [{**each, "name": HOSTILE} for each in one.description["inputs"]],
        }
        assert one.arm.scene is not None
        bodies = tuple(replace(each, name=HOSTILE) for each in one.arm.scene.bodies)
        metrics = tuple((HOSTILE, values + 1.0) for _, values in one.metrics)
        one = replace(
            one, description=told, metrics=metrics, arm=replace(one.arm, scene=replace(one.arm.scene, bodies=bodies))
        )
        other = replace(other, arm=replace(other.arm, scene=None, lacking=(HOSTILE,)))
        again = replace(section.simulation, structures=(one, other), notes=(HOSTILE,))
        wild = replace(hostile(replace(section, simulation=None)), simulation=again)
        (tmp_path / "wild.html").write_text(html_page(replace(hostile(found), sections=(wild,))), encoding="utf-8")
        shown = opened(chromium, tmp_path / "wild.html")
        assert section.signals is not None and section.signals.opens in other.cases
        why = f"its arm is not drawn, for the run does not record {VISIBLE}"
        assert shown.run(SAID).startswith(f"Case #{section.signals.opens} would be shown first, but {why}. Case #")
        shown.run("MET.models[0].choose(0)")
        shown.settle()
        assert f"in the archive in {VISIBLE}: run again" in shown.run(SAID)
        shown.run("MET.models[0].choose(5)")
        shown.settle()
        assert f"the run does not record {VISIBLE}: " in shown.run("document.querySelector('.arm').innerText")
        assert shown.run("window.hostile") is None
        assert shown.run("document.querySelectorAll('img, script:not([type]):not(:last-of-type)').length") == 0
        quiet(shown)
        shown.close()

    def test_a_table_of_many_columns_shows_them_all(self, chromium: Chromium, tmp_path: Path) -> None:
        names = [f"torque_of_the_shoulder_as_measured_at_number_{n}" for n in range(9)]
        metrics = " ".join(f"metric {name} = peak {{ of = shoulder.tau; }}" for name in names)
        deck = DECK.replace("initial {", f"{metrics} require {names[0]} < 900 N*m;  initial {{")
        batch.run(archives.compiled(tmp_path, "many", deck=deck), output=tmp_path / "a.h5")
        for width in (1280, 400):
            page = chromium.open(report(tmp_path / "a.h5"), width=width)
            page.settle()
            page.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
            page.settle()
            assert page.run(CLIPPED) == []
            heads = page.run("getComputedStyle(document.querySelector('.cases thead')).display")
            assert heads == "none"  # each number has its heading beside it
            page.close()

    @pytest.mark.parametrize("width", [1280, 400])
    def test_all_that_is_read_at_the_pointer_is_seen_and_no_plot_moves(
        self, chromium: Chromium, compared: Path, width: int
    ) -> None:
        page = opened(chromium, compared / "b.html", width=width)
        left, top, wide, high = page.box(".signals .u-over", 1)
        page.mouse("mouseMoved", left + 0.5 * wide, top + 0.5 * high)
        page.settle()
        hidden = "e => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1"
        assert page.run("document.querySelector('.reading').textContent").count("before") == 2
        assert page.run(f"Array.from(document.querySelectorAll('.reading')).filter({hidden}).length") == 0
        assert page.box(".signals .u-over", 1)[1] == top
        quiet(page)
        page.close()

    @pytest.mark.release
    def test_on_paper_it_is_a_filmstrip(self, chromium: Chromium, sent: Path, tmp_path: Path) -> None:
        page = opened(chromium, sent / "many.html")
        page.pdf(tmp_path / "a.pdf")
        times = page.run("Array.from(document.querySelectorAll('.stage figcaption'), e => e.textContent)")
        assert times == ["0 s", "0.4 s", "0.8 s", "1.2 s", "1.6 s", "2 s"]
        quiet(page)
        page.close()


CLIPPED = """(() => {
    const scrolls = e => ['auto', 'scroll'].includes(getComputedStyle(e).overflowX);
    const inside = e => e.parentElement && (scrolls(e.parentElement) || inside(e.parentElement));
    const drawn = 'svg, .u-wrap, .reading, .panel .head, .view, select, input';
    return Array.from(document.querySelectorAll('header *, main *, footer *')).filter(e => {
        if (!e.offsetParent || e.closest(drawn)) return false;
        if (e.matches('.wide')) return e.scrollWidth > e.clientWidth + 1;
        if (inside(e)) return false;
        const box = e.getBoundingClientRect();
        return box.width > 1 && (box.right > document.documentElement.clientWidth + 1 || box.left < -1);
    }).map(e => `${e.tagName}.${e.className} ${e.getAttribute('aria-label') || ''}`);
})()"""
"""Elements that reach beyond the window, and tables that do not show all their columns; code scrolls by itself."""
