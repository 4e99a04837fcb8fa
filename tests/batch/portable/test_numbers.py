"""`met view ARCHIVE --numbers DECK`: numbers of the deck are dragged on the page, by a second module."""

from __future__ import annotations

import json
import random
import re
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from batch.archive.read import ArchiveFile
from batch.portable import page as portable_page
from batch.portable.numbers import OtherNumbers, deck_of, limits, varied
from ic.driver.given_values import given_run
from met import cli
from met.backends.wasm.module import KERNEL_JS
from met.unit_parser import parse_unit
from tests.batch.portable.test_view import (  # noqa: F401 - a fixture
    CHOOSE,
    HOSTILE,
    MOVE,
    SAID,
    Chromium,
    chromium,
    quiet,
)

NUMBERS_JS = Path(portable_page.__file__).with_name("assets") / "numbers.js"

DECK = """\
#ifndef HEAVY
#define HEAVY 0
#endif
let begin = 20 deg;
arm crane {
    link cart { mass = 1200 g; shape = box(size = [100, 100, 100] mm); }
    link boom { mass = 1 kg + HEAVY * 1 kg; shape = cylinder(radius = 2 cm, length = 500 mm, along = x); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
    joint turn  revolute  { parent = cart; child = boom; axis = z; }
}
run it {
    arm = crane;  initial { slide.q = 12.3 mm; slide.qd = 0.5 m/s;  turn.q = -begin; turn.qd = 3 rpm; }
    environment { drag = joint_damping { sliding = 0.3 N*s/m; damping = 0.4 N*mm*s/deg; } }
    rates { dynamics = 100 Hz; record = 50 Hz; }  duration = 1 s;  record = [q, qd];
    metric far = final { of = slide.q; }   require far < 70 cm;
    metric low = min   { of = turn.q; }    require low > -21 deg;
}
sweep cranes of it { vary links.cart.mass = [900, 2000] g; }
sweep ways of it { vary integrator = [modified_euler, rk4]; vary links.cart.mass = [900, 2000] g; }
sweep loads of it { vary macro HEAVY = [0, 1]; vary initial.slide.qd = [0.4, 0.5] m/s; }
"""


def met(*words: object) -> int:
    return cli.main([str(word) for word in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A deck, and archives of its run and of its sweeps with their pages."""
    folder = tmp_path_factory.mktemp("numbers")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    for name in ("it", "cranes", "ways", "loads"):
        assert met("run", folder / "deck.ic", name, "-q", "--no-picture", "-o", folder / f"{name}.h5") in (0, 1)
    for name in ("it", "cranes"):
        assert met("view", folder / f"{name}.h5", "-q", "--numbers", folder / "deck.ic") == 0
    return folder


def numbers_of(folder: Path, archive: str, group: str) -> OtherNumbers:
    with ArchiveFile(folder / archive) as file:
        experiment = next(each for each in file.plan().experiments if each.name == group)
        return deck_of(file, experiment, folder / "deck.ic")


def data_in(page: Path) -> dict[str, Any]:
    found = re.search(r"const MET_PAGE = (.*);\n", page.read_text(encoding="utf-8"))
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


@pytest.mark.slow
def test_limits_are_where_the_deck_is_refused() -> None:
    made = varied(given_run("two_link.ic", "nominal")).run
    found = dict(zip((each.path for each in made.experiment.cases.coordinates), limits(made), strict=True))
    mass = found["links.upper.mass"]
    assert mass["low"] == 0.0 and mass["below"] == "`mass` of link `upper` must be at least 0 kg"
    assert mass["high"] == 40.0 * 1001.0 and mass["above"] == "it is more than 1000 times as far as the deck's"
    assert found["shoulder.servo.kp"]["low"] <= 0.0 < found["shoulder.servo.kp"]["high"]
    for path, each in found.items():  # both ends are allowed, and what lies beyond is not, where the deck says so
        own = {c.path: np.array([float(c.values[0])]) for c in made.experiment.cases.coordinates}
        for end, beyond in (("low", -1.0), ("high", 1.0)):
            assert not made.broken({**own, path: np.array([each[end]])}, 1)[0]
            if "more than 1000" not in each["below" if end == "low" else "above"]:
                further = each[end] + beyond * max(1e-9, 1e-9 * abs(each[end]))
                assert made.broken({**own, path: np.array([further])}, 1)[0]


@pytest.mark.release
def test_another_deck_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "other.ic").write_text(DECK.replace("12.3", "12.4"), encoding="utf-8")
    assert met("view", folder / "it.h5", "--numbers", tmp_path / "other.ic") == 2
    assert capsys.readouterr().err == (
        f"error[E479]: {tmp_path / 'other.ic'} is not the deck that the archive was made with, or includes other "
        "files\n = help: run it again, and view the new archive\n\n1 error\n"
    )


@pytest.mark.slow
def test_what_a_deck_reads_must_be_as_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "shared"
    folder.mkdir()
    (folder / "part.ic").write_text("let begin = 20 deg;\n", encoding="utf-8")
    (tmp_path / "deck.ic").write_text(DECK.replace("let begin = 20 deg;", '#include "part.ic"'), encoding="utf-8")
    words = ["-q", "--no-picture", "-o", tmp_path / "a.h5"]
    assert met("run", tmp_path / "deck.ic", "it", "-I", folder, *words) == 0
    assert met("view", tmp_path / "a.h5", "-q", "--numbers", tmp_path / "deck.ic", "-I", folder) == 0
    assert "turn.q" in str(data_in(tmp_path / "a.view.html")["numbers"]["labels"])
    (folder / "part.ic").write_text("let begin = 21 deg;\n", encoding="utf-8")
    assert met("view", tmp_path / "a.h5", "-q", "--numbers", tmp_path / "deck.ic", "-I", folder) == 2
    assert "error[E479]: " in capsys.readouterr().err
    assert met("view", tmp_path / "a.h5", "-q", "-I", folder) == 2  # without the deck it would do nothing
    assert "-I is for decks" in capsys.readouterr().err


@pytest.mark.slow
def test_of_a_sweep_they_are_those_of_its_run(folder: Path) -> None:
    found = numbers_of(folder, "cranes.h5", "cranes")
    assert found.run_name == "it" and found.fixed == () and found.run.experiment.cases.count == 1
    cart = next(each for each in found.run.experiment.cases.coordinates if each.path == "links.cart.mass")
    assert float(cart.values[0]) == 1.2
    data = data_in(folder / "cranes.view.html")
    assert data["head"]["name"] == "cranes" and data["numbers"]["head"]["name"] == "it"
    lede = data["numbers"]["head"]["lede"]
    assert "the others are those of `it`, which `cranes` varies. " in lede
    keys = [re.search(r"\(program ([0-9a-f]{8})\)", each["lede"]) for each in (data["head"], data["numbers"]["head"])]
    assert all(keys) and keys[0][1] != keys[1][1]  # type: ignore[index]


@pytest.mark.slow
def test_of_several_structures_they_are_of_the_one_that_is_viewed(folder: Path) -> None:
    found = {name: numbers_of(folder, "ways.h5", f"ways.{name}") for name in ("modified_euler", "rk4")}
    for name, each in found.items():
        assert each.run.experiment.structure.integrator == name and each.fixed == (f"integrator = {name}",)
    with ArchiveFile(folder / "loads.h5") as file:
        groups = {each.cases.choices[0].value: each.name for each in file.plan().experiments}
    for value, group in groups.items():
        each = numbers_of(folder, "loads.h5", group)
        mass = next(c for c in each.run.experiment.cases.coordinates if c.path == "links.boom.mass")
        assert float(mass.values[0]) == 1.0 + float(value) and each.fixed == (f"macro HEAVY = {value}",)


@pytest.mark.slow
def test_an_archive_of_vary_or_set_has_them_too(folder: Path, tmp_path: Path) -> None:
    deck = folder / "deck.ic"
    words = ["-q", "--no-picture", "-o", tmp_path / "a.h5"]
    assert met("run", deck, "it", *words, "--vary", "links.cart.mass=[900, 2000] g", "--set", "begin=19 deg") == 0
    with ArchiveFile(tmp_path / "a.h5") as file:
        found = deck_of(file, file.plan().experiments[0], deck)
    at = {each.path: float(each.values[0]) for each in found.run.experiment.cases.coordinates}
    assert found.run_name == "it" and at["links.cart.mass"] == 1.2
    assert found.left_out == ("initial.turn.q",)  # which follows what was set
    assert float(found.plan.experiments[0].parameters["initial.turn.q"].value) == -parse_unit("deg").to_si(19.0)  # type: ignore[arg-type]


def test_they_are_in_the_units_in_which_the_deck_writes_them(folder: Path) -> None:
    data = data_in(folder / "it.view.html")["numbers"]
    units = dict(zip(data["labels"], data["units"], strict=True))
    assert units == {
        "links.cart.mass": "g", "links.boom.mass": "kg", "slide.axis.x": "", "slide.axis.y": "", "slide.axis.z": "",
        "turn.axis.x": "", "turn.axis.y": "", "turn.axis.z": "", "environment.drag.damping": "N·mm·s/deg",
        "environment.drag.sliding": "N·s/m", "initial.slide.q": "mm", "initial.turn.q": "deg",
        "initial.slide.qd": "m/s", "initial.turn.qd": "rpm",
    }  # fmt: skip
    assert data["columnUnits"] == ["cm", "deg", "m/s", "rpm"] and data["metricUnits"] == ["cm", "deg"]


def test_numbers_that_cannot_vary_are_told(tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(DECK.replace("axis = z", "axis = z; at = [0, 0, 3] m"), encoding="utf-8")
    made = varied(given_run(tmp_path / "deck.ic", "it"))
    paths = [each.path for each in made.run.experiment.cases.coordinates]
    assert made.left_out and not set(made.left_out) & set(paths)
    run = given_run(tmp_path / "deck.ic", "it")
    numbers = {p: e for p, e in run.experiment.parameters.items() if isinstance(e.value, float)}
    for path in made.left_out:  # each alone is refused, too
        with pytest.raises(Exception, match=r"changes nothing in this run"):
            run.vary({path: (numbers[path].value, numbers[path].unit)})  # type: ignore[dict-item]


IN_NODE = """\
const { readFileSync, writeFileSync } = require("fs");
const vm = require("vm");
globalThis.MET = {};
vm.runInThisContext(readFileSync(process.argv[2], "utf8"));
"""

CONVERT = """\
const bits = JSON.parse(readFileSync("asked.json")).map(([text, over, under]) =>
  String(new BigInt64Array(Float64Array.of(MET.numbers.inSI(text, [over, under])).buffer)[0]));
writeFileSync("found.json", JSON.stringify(bits));
"""

COMPUTE = """\
const METKernel = require(process.argv[3]);
const data = JSON.parse(readFileSync("data.json")), told = data.description, own = told.cases.inputs[0];
const kernel = METKernel.make(Uint8Array.from(Buffer.from(data.module, "base64")), told.kernel);
const shown = own.map((value, n) => MET.numbers.written(value, told.inputs[n].scale, data.exact[n]));
const cases = JSON.parse(readFileSync("moved.json")).map(([path, text]) =>
  own.map((value, n) => (told.inputs[n].name === path ? MET.numbers.inSI(text, data.exact[n]) : value)));
const { rows, outputs } = kernel.run(cases, told.ticks);
writeFileSync("rows", rows);
writeFileSync("outputs", outputs);
writeFileSync("shown.json", JSON.stringify(shown));
"""


def node(folder: Path, script: str) -> None:
    found = shutil.which("node")
    if found is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    (folder / "run.js").write_text(IN_NODE + script, encoding="utf-8")
    subprocess.run([found, "run.js", str(NUMBERS_JS), str(KERNEL_JS)], check=True, cwd=folder)


@pytest.mark.node
def test_a_decimal_in_a_unit_is_rounded_once_as_a_deck_rounds_it(tmp_path: Path) -> None:
    dice = random.Random(25)
    units = ["deg", "mm", "rpm", "g", "deg/s", "ms", "kN", "cm^2", "rad", "1/deg", "%", "V*s/deg", "N*mm*s/deg"]
    asked, expected = [], []
    for _ in range(4000):
        measure = parse_unit(dice.choice(units))
        text = dice.choice([
            repr(dice.uniform(0.0, 1e3)), f"{dice.uniform(0.0, 90.0):.{dice.randint(1, 12)}g}", "0", ".5", "5.",
            f"{dice.uniform(1.0, 9.0) * 10.0 ** dice.randint(-322, 300):.5e}",
        ])  # fmt: skip
        asked.append((text, str(measure.exact.numerator), str(measure.exact.denominator)))
        expected.append(str(struct.unpack("<q", struct.pack("<d", measure.to_si(float(text), text)))[0]))
    (tmp_path / "asked.json").write_text(json.dumps(asked), encoding="utf-8")
    node(tmp_path, CONVERT)
    assert json.loads((tmp_path / "found.json").read_text()) == expected


MOVED = [
    ("links.cart.mass", "987.6"), ("links.boom.mass", "1.7"), ("initial.turn.q", "-17.3"), ("initial.slide.q", "0.1"),
    ("initial.turn.qd", "7.7"), ("environment.drag.damping", "0.123"), ("turn.axis.y", "0.01"),
    ("links.cart.mass", "0"),
]  # fmt: skip


@pytest.mark.release
@pytest.mark.node
@pytest.mark.parametrize(("group", "moved"), [("it", MOVED), ("ways.rk4", MOVED[:2])])
def test_the_second_module_has_the_bits_of_met_run_vary_of_its_numbers(
    folder: Path, tmp_path: Path, group: str, moved: list[tuple[str, str]]
) -> None:
    name = group.partition(".")[0]
    words = [folder / f"{name}.h5", *([group] if group != name else []), "-q", "-o", tmp_path / "a.html"]
    assert met("view", *words, "--numbers", folder / "deck.ic") == 0
    data = data_in(tmp_path / "a.html")["numbers"]
    told = data["description"]
    (tmp_path / "data.json").write_text(json.dumps(data), encoding="utf-8")
    (tmp_path / "moved.json").write_text(json.dumps(moved), encoding="utf-8")
    node(tmp_path, COMPUTE)
    shown = json.loads((tmp_path / "shown.json").read_text())
    assert dict(zip(data["labels"], shown, strict=True)).items() >= {
        "links.cart.mass": "1200", "initial.turn.q": "-20", "initial.turn.qd": "3", "initial.slide.q": "12.3",
    }.items()  # fmt: skip
    rows = np.frombuffer((tmp_path / "rows").read_bytes()).reshape(len(moved), told["rows"], -1)
    outputs = np.frombuffer((tmp_path / "outputs").read_bytes()).reshape(len(moved), -1)
    settings = ["--set", "integrator=rk4"] if group == "ways.rk4" else []
    compared = 0
    for n, (path, text) in enumerate(moved):
        vary = []
        for each, decimal in zip(told["inputs"], shown, strict=True):
            unit = "" if each["unit"] == "1" else f" {each['unit']}"
            vary += ["--vary", f"{each['name']}=[{text if each['name'] == path else decimal}]{unit}"]
        archive = tmp_path / f"{n}.h5"
        words = ["run", folder / "deck.ic", "it", "-q", "--no-picture", *vary, *settings, "-o", archive]
        assert met(*words) in (0, 1)
        with xarray.open_dataset(archive) as run:
            for column, each in enumerate(told["columns"]):
                joint = each["channel"].removesuffix(f".{each['signal']}")
                native = run[each["signal"]].isel(recorded_case=0).sel(joint=joint).values
                assert rows[n, :, column].tobytes() == native.tobytes(), (path, each["channel"])
                compared += native.size
            for each in told["metrics"]:
                assert outputs[n, each["output"]].tobytes() == run[each["name"]].values[0].tobytes(), (path, each)
                compared += 1
    assert compared == len(moved) * (told["rows"] * 4 + 2)


SWITCH = "document.querySelector('.other-numbers').click()"
PICK = """(path => { const e = document.querySelector('.other select');
    e.value = [...e.options].find(o => o.textContent === path).value; e.dispatchEvent(new Event('change')); })"""
TYPE = """(value => { const e = document.querySelector('.typed input'); e.value = value;
    e.dispatchEvent(new Event('change')); return document.querySelector('.answers').innerText; })"""
DRAG = """(at => { const e = document.querySelector('.other input[type=range]'); e.value = at;
    e.dispatchEvent(new Event('input')); return document.querySelector('.typed input').value; })"""
HEAD = """['.kicker', 'h1', '.lede'].map(each => document.querySelector('header ' + each).textContent)"""
REFUSED = "document.querySelector('[role=alert]').textContent"
AT = "(path => MET.page.values()[MET.page.inputs().findIndex(each => each.name === path)])"


@pytest.mark.browser
def test_a_number_is_dragged_and_typed_in_the_decks_unit_and_turns_the_verdict(
    chromium: Chromium,  # noqa: F811
    folder: Path,
) -> None:
    page = chromium.open(folder / "it.view.html")
    page.settle()
    assert page.run(SAID).startswith("The run, with the archive's bits")
    page.run(SWITCH)
    assert page.run(SAID).startswith("By another program than the archive's, so that last digits may differ: ")
    page.run(f"{PICK}('initial.turn.q')")
    assert page.run("document.querySelector('.typed').innerText").strip() == "deg"
    assert page.run("document.querySelector('.typed input').value") == "-20"
    said = {value: page.run(f"{TYPE}('{value}')").split(": ")[-1] for value in ("-20.5", "-22")}
    assert said == {"-20.5": "met", "-22": "missed by 1 deg, at 0 s"}
    assert page.run(f"{AT}('initial.turn.q')") == -parse_unit("deg").to_si(22.0, "22")
    assert page.run(f"{DRAG}(0.25)") == "-30" and page.run(f"{DRAG}(0.503)") == "-20"  # near the deck's, which it takes
    assert page.run("document.querySelector('.told').textContent") == "the deck's numbers"
    page.run(f"{PICK}('links.cart.mass')")
    page.run(f"{TYPE}('-1')")
    assert page.run(REFUSED) == "-1 g is refused: `mass` of link `cart` must be at least 0 kg"
    assert page.run(f"{AT}('links.cart.mass')") == 1.2  # as it was
    page.run(f"{TYPE}('heavy')")
    assert page.run(REFUSED) == "heavy g is refused: it is no number"
    page.settle()
    quiet(page)
    page.close()


@pytest.mark.browser
def test_the_switch_changes_what_stands_above_and_gives_back_what_one_had(
    chromium: Chromium,  # noqa: F811
    folder: Path,
) -> None:
    page = chromium.open(folder / "cranes.view.html")
    page.settle()
    page.run(f"{MOVE}(0, 0.4)")
    archived, said, mass = page.run(HEAD), page.run(SAID), page.run(f"{AT}('links.cart.mass')")
    assert archived[:2] == ["A page that simulates", "cranes"] and "made with (program " in archived[2]
    assert page.run("document.title") == "cranes" and said.startswith("Not in the archive: ")
    page.run("MET.shown.camera.orbit(0.3, 0.1); MET.shown.seek(0.5)")
    seen = page.run("JSON.stringify(MET.shown.kept())")

    page.run(SWITCH)
    other = page.run(HEAD)
    assert other[:2] == ["Other numbers than the archive's", "it"] and page.run("document.title") == "it"
    assert "another program than the archive's" in other[2] and "made with" not in "".join(other)
    assert "bits of" not in page.run(SAID) and "archive's bits" not in page.run(SAID)
    assert page.run("JSON.stringify(MET.shown.kept())") == seen
    page.run(f"{PICK}('links.boom.mass')")
    page.run(f"{TYPE}('2.5')")

    page.run(SWITCH)
    assert page.run(HEAD) == archived and page.run("document.title") == "cranes"
    assert page.run(SAID).partition(":")[0] == said.partition(":")[0]
    assert page.run(f"{AT}('links.cart.mass')") == mass
    assert page.run(f"{CHOOSE}(1)").startswith("Case #1, with the archive's bits in all 2 metrics: ")
    page.run(SWITCH)
    assert page.run(f"{AT}('links.boom.mass')") == 2.5
    assert page.run("document.querySelector('.typed input').value") == "2.5"
    for _ in range(20):  # no view of the arm is left behind
        page.run(SWITCH)
    page.settle()
    assert page.run("MET.drawn.length") == 1 and page.run("document.querySelectorAll('.stage').length") == 1
    quiet(page)
    page.close()


@pytest.mark.browser
def test_hostile_texts_of_a_deck_and_of_its_numbers_are_texts(
    chromium: Chromium,  # noqa: F811
    folder: Path,
    tmp_path: Path,
) -> None:
    tag = "<img src=x onerror=document.title='hurt'>"
    named = tmp_path / f"{tag}.ic"
    text = DECK.replace("let begin", f"// </script>{tag}\nlet begin").replace("far <", f"far /* </script>{tag} */ <")
    named.write_text(text, encoding="utf-8")
    assert met("run", named, "cranes", "-q", "--no-picture", "-o", tmp_path / "a.h5") == 0
    assert met("view", tmp_path / "a.h5", "-q", "--numbers", named) == 0
    real = chromium.open(tmp_path / "a.view.html")
    real.settle()
    real.run(SWITCH)
    real.settle()
    assert real.run("document.title") == "it" and real.run("document.querySelectorAll('img').length") == 0
    quiet(real)
    real.close()

    with ArchiveFile(folder / "it.h5") as file:
        experiment = file.plan().experiments[0]
        data = portable_page.data_of(experiment, file, file.groups[0])
        numbers = portable_page._numbers(deck_of(file, experiment, folder / "deck.ic"), experiment)
    count = len(numbers["labels"])
    numbers["labels"] = numbers["units"] = [HOSTILE] * count
    numbers["metricUnits"] = numbers["columnUnits"] = numbers["leftOut"] = [HOSTILE] * 4
    numbers["head"] = dict.fromkeys(("kicker", "name", "lede"), HOSTILE)
    for each in numbers["limits"]:
        each.update(below=HOSTILE, above=HOSTILE)
    for key in ("inputs", "columns", "metrics", "requirements"):
        for each in numbers["description"][key]:
            each.update({name: HOSTILE for name in ("name", "channel", "signal", "metric", "text") if name in each})
    (tmp_path / "hostile.html").write_text(
        portable_page.page_of(experiment, data | {"numbers": numbers, "head": numbers["head"]}), encoding="utf-8"
    )
    page = chromium.open(tmp_path / "hostile.html")
    page.settle()
    page.run(SWITCH)
    page.run(f"{TYPE}(1e9)")
    page.run("document.querySelector('details').open = true")
    page.settle()
    for place in ("h1", ".kicker", ".lede", ".other select", ".typed", "[role=alert]", "details", ".answers", ".panel"):
        assert "onerror" in page.run(f"document.querySelector('{place}').textContent"), place
    assert page.run("document.querySelectorAll('img').length") == 0 and page.run("window.hurt") is None
    assert page.run("document.title") != "hurt"
    quiet(page)
    page.close()


def test_the_page_loosens_no_rule_for_a_second_module(folder: Path) -> None:
    rules = [
        re.sub(r"'sha256-[^']*'", "DIGEST", found[1])
        for name in ("it", "cranes")
        if (
            found := re.search(
                r'Content-Security-Policy" content="([^"]*)"', (folder / f"{name}.view.html").read_text()
            )
        )
    ]
    allowed = "default-src 'none'; script-src DIGEST 'wasm-unsafe-eval'; style-src DIGEST; img-src data:; "
    assert rules == [f"{allowed}base-uri 'none'; form-action 'none'"] * 2
    assert (folder / "it.view.html").read_text().count("<script") == 1


@pytest.mark.release
@pytest.mark.browser
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_of_other_numbers_is_wider_than_a_phone(
    chromium: Chromium,  # noqa: F811
    folder: Path,
    tmp_path: Path,
    dark: bool,
) -> None:
    text = DECK.replace("boom", "boom_of_the_crane_that_has_a_name_longer_than_a_telephone_is_wide")
    (tmp_path / "deck.ic").write_text(text.replace("axis = z", "axis = z; at = [0, 0, 3] m"), encoding="utf-8")
    assert met("run", tmp_path / "deck.ic", "it", "-q", "--no-picture", "-o", tmp_path / "a.h5") in (0, 1)
    assert met("view", tmp_path / "a.h5", "-q", "--numbers", tmp_path / "deck.ic") == 0
    page = chromium.open(tmp_path / "a.view.html", width=400, dark=dark)
    page.settle()
    page.run(SWITCH)
    page.run("document.querySelector('details').open = true")
    for path in page.run("MET.page.data.labels"):
        page.run(f"{PICK}({json.dumps(path)})")
        page.run(f"{TYPE}('-1234567.8901')")
        page.settle()
        assert page.run("document.documentElement.scrollWidth") <= 400, path
        clipped = page.run("""[...document.querySelectorAll('header *, .other, .other *, .came, .answers td')]
            .filter(e => { const b = e.getBoundingClientRect(); return b.width && (b.right > 400.5 || b.left < -0.5); })
            .map(e => e.outerHTML.slice(0, 80))""")
        assert clipped == [], path
        wide = page.run("""[...document.querySelectorAll('header *, .other p, .other code, .other summary, .came, td')]
            .filter(e => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline')
            .map(e => e.outerHTML.slice(0, 80))""")
        assert wide == [], path
    assert page.run("document.querySelector('.typed input').getBoundingClientRect().width") >= 70
    page.picture(folder / f"phone{dark}.png")
    quiet(page)
    page.close()
