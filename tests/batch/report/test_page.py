"""The page: whole in one file, the same bytes for the same archive, and no text of a deck is ever markup in it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.archive.read import ArchiveFile
from batch.report import report
from batch.report.contents.gathering import gather
from batch.report.contents.parts import Report
from batch.report.html import inlined
from batch.report.html.blocks import share
from batch.report.html.markup import VOID, el, text, visible
from batch.report.html.page import page
from batch.report.html.payload import packed, script_json
from tests.batch import plans
from tests.batch.report import archives
from tests.batch.report.archives import HOSTILE

KEPT = frozenset({"key", "role", "kind", "sense", "word", "x", "y", "start", "status"})
"""Fields that are ours and not a deck's."""


class Parsed(HTMLParser):
    """The elements of a page, each with its attributes and text; what is opened has to be closed."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self._open: list[str] = []
        self.feed(source)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self._open[-1] if self._open else "", data))

    def handle_comment(self, data: str) -> None:
        raise AssertionError(f"a comment: {data}")


def hostile(value: Any) -> Any:
    """The same, and every text of a deck in it is one that would like to be markup."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value,
            **{field.name: hostile(getattr(value, field.name)) for field in fields(value) if field.name not in KEPT},
        )
    if isinstance(value, tuple):
        return tuple(hostile(each) for each in value)
    if isinstance(value, dict):
        return {key: hostile(each) for key, each in value.items()}
    return HOSTILE + value if isinstance(value, str) else value


@pytest.fixture
def found(here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> Report:
    archives.failing(monkeypatch, 2, 3)
    one = archives.grid([0.01, 0.02, 0.03, 0.04], [20.0, 21.0, 22.0])
    with ArchiveFile(archives.made(here / "a.h5", one, plans.nominal())) as file:
        return gather(file)


def data_of(source: str) -> Iterator[Any]:
    for found in re.finditer(r'<script type="application/json" id="d\d+">(.*?)</script>', source, re.DOTALL):
        yield json.loads(found[1])


@pytest.mark.slow
def test_every_element_is_closed_and_every_link_leads_somewhere(found: Report) -> None:
    parsed = Parsed(page(found))
    ids = [about["id"] for _, about in parsed.elements if "id" in about]
    assert len(ids) == len(set(ids))
    links = [about["href"] for tag, about in parsed.elements if tag == "a"]
    assert len(links) >= 6 and all(link is not None and link[1:] in ids for link in links)


@pytest.mark.slow
def test_nothing_is_fetched_and_all_else_is_forbidden(found: Report) -> None:
    source = page(found)
    parsed = Parsed(source)
    assert not [tag for tag, about in parsed.elements if tag in ("img", "iframe", "object", "embed") or "src" in about]
    assert [about["href"] for tag, about in parsed.elements if tag == "link"] == ["data:,"]
    assert not [about for _, about in parsed.elements if any(n == "style" or n.startswith("on") for n in about)]
    policies = [about for _, about in parsed.elements if about.get("http-equiv") == "Content-Security-Policy"]
    [rules] = [about["content"] for about in policies]
    assert rules is not None and rules.startswith("default-src 'none'; script-src 'sha256-") and "unsafe" not in rules
    for tag, rule in (("script", "script-src"), ("style", "style-src")):
        [body] = re.findall(rf"<{tag}>(.*?)</{tag}>", source, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"{rule} 'sha256-{digest}'" in rules
    assert "url(" not in inlined.style() and "@import" not in inlined.style()


@pytest.mark.slow
def test_no_text_of_a_deck_is_markup(found: Report) -> None:
    usual, wild = Parsed(page(found)), Parsed(page(hostile(found)))
    assert {tag for tag, _ in wild.elements} <= {tag for tag, _ in usual.elements}
    scripts = [words for tag, words in wild.texts if tag == "script" and "window.hostile" in words]
    assert len(scripts) == len(found.sections)  # the data, which is no script
    source = page(hostile(found))
    for data in data_of(source):
        assert HOSTILE[:9] in data["name"]
    assert source.count("</script>") == 1 + len(found.sections)
    assert "\u202e" not in source and "\x00" not in source


@pytest.mark.slow
def test_a_text_that_is_no_unicode_can_be_written(found: Report) -> None:
    source = page(replace(found, title="arm \udcff", archive="\ud800.h5"))
    source.encode("utf-8")
    assert "arm \\udcff" in source


@pytest.mark.slow
def test_the_same_archive_gives_the_same_bytes(here: Path, engine: None) -> None:
    path = archives.made(here / "a.h5", plans.gains(30))
    one, other = (report(path, here / name).read_bytes() for name in ("1.html", "2.html"))
    assert one == other


@pytest.mark.slow
def test_it_is_small_but_for_its_data(found: Report) -> None:
    source = page(found)
    data = sum(len(json.dumps(each)) for each in data_of(source))
    assert len(source.encode()) - data < 300_000


@pytest.mark.slow
def test_it_reads_without_scripts(found: Report) -> None:
    words = " ".join(text for tag, text in Parsed(page(found)).texts if tag not in ("script", "style"))
    for said in (
        "0 of 12 cases meet every requirement",
        "settle < 10 s",
        "met run a.h5 gains --case '#2'",
        "2 cases failed",
        "shoulder.servo.kp",
        "run nominal { }",
        "The plots need JavaScript",
    ):
        assert said in re.sub(r"\s+", " ", words)


@pytest.mark.slow
def test_answers_come_first(here: Path, engine: None) -> None:
    one = archives.grid([0.01, 0.02, 0.03, 0.04], [20.0, 21.0, 22.0])
    one = replace(one, requirements=tuple(replace(each, limit=20.0) for each in one.requirements))
    source = report(archives.made(here / "a.h5", one)).read_text(encoding="utf-8")
    parts = ("s0-designs", "verdict", "s0-evidence", "s0-best", "s0-worst", "s0-overview", "s0-signals", "s0-run")
    places = [source.index(f'<section id="{part}"') for part in parts]
    assert places == sorted(places)
    links = re.findall(r'<a href="#([\w-]+)">', source[source.index("<nav") : source.index("</nav>")])
    assert links == [*parts, "parameters", "provenance"]
    assert '<a href="#main" class="skip">' in source
    assert "All that was tried" in source and "Requirements not met" not in source, "candidates are no failure"


@pytest.mark.slow
def test_where_no_design_serves_the_verdict_says_so(here: Path, engine: None) -> None:
    one = archives.grid([0.01, 0.02, 0.03, 0.04], [20.0, 21.0, 22.0])
    one = replace(one, requirements=tuple(replace(each, limit=-1.0) for each in one.requirements))
    source = report(archives.made(here / "a.h5", one)).read_text(encoding="utf-8")
    assert source.index('<section id="s0-designs"') < source.index('<section id="verdict"')
    assert "Requirements not met" in source and "All that was tried" not in source


@pytest.mark.slow
def test_a_verdict_of_another_kind_stands_beside_the_first(found: Report) -> None:
    other = replace(found.verdicts[0], kind="difference", about="against b.h5", headline="3 cases differ")
    source = page(replace(found, verdicts=(*found.verdicts, other)))
    assert "against b.h5" in source and "3 cases differ." in source


class TestWhatIsVendored:
    README = (inlined.FOLDER / "README.md").read_text(encoding="utf-8")

    @pytest.mark.parametrize("name", ["uPlot.iife.min.js", "uPlot.min.css", "uPlot.LICENSE"])
    def test_is_what_was_fetched(self, name: str) -> None:
        [digest] = re.findall(rf"^\| `{re.escape(name)}` .*`([0-9a-f]{{64}})` \|$", self.README, re.MULTILINE)
        assert hashlib.sha256((inlined.FOLDER / name).read_bytes()).hexdigest() == digest

    def test_goes_with_its_licence(self) -> None:
        licence = (inlined.FOLDER / "uPlot.LICENSE").read_text(encoding="utf-8").strip()
        assert licence.startswith("The MIT License") and licence in inlined.script()
        [version] = re.findall(r"`uplot` (\S+) of the npm registry", self.README)
        assert f"(v{version})" in inlined.script()

    def test_all_files_of_the_folder_are_used(self) -> None:
        named = {*inlined.SCRIPTS, *inlined.SIMULATING, inlined.LAST, *inlined.STYLES, "uPlot.LICENSE", "README.md"}
        assert {path.name for path in inlined.FOLDER.iterdir()} == named

    def test_is_installed_with_the_package(self) -> None:
        text = (Path(inlined.__file__).parents[3] / "setup.cfg").read_text(encoding="utf-8")
        packaged = next(line for line in text.splitlines() if line.startswith("batch = py.typed"))
        assert "report/html/assets/*" in packaged.removeprefix("batch = ").split(", ")


class TestNumbers:
    def unpacked(self, data: dict[str, Any]) -> np.ndarray:
        """As `MET.unpack` of core.js."""
        if data["t"] == "c":
            return np.full(data["n"], data["v"])
        kind = {"i4": "<i4", "f4": "<f4", "f8": "<f8"}[data["t"]]
        return np.frombuffer(base64.b64decode(data["b"]), kind).astype(float) + data.get("o", 0.0)

    @pytest.mark.parametrize(
        ("values", "kind"),
        [
            (np.arange(5), "i4"),
            (np.array([1e300, 2.0]), "f8"),
            (np.full(9, 0.1), "c"),
            (np.array([]), "f8"),
            (1e6 + np.linspace(0.0, 1e-3, 50), "f4"),
            (np.array([np.nan, np.inf, -np.inf, 1.0, 0.3]), "f4"),
            (np.array([2**40, 1]), "f4"),
            (np.array([-1.7e308, 1.7e308]), "f8"),
            (np.array([1.0, 1e-30]), "f4"),
        ],
    )
    def test_survive_to_a_millionth_of_their_range(self, values: np.ndarray, kind: str) -> None:
        data = packed(values)
        assert data["t"] == kind
        finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
        span = float(np.ptp(finite / 2)) * 2 if len(finite) else 0.0
        close = pytest.approx(values.astype(float), abs=min(1e-6 * span, 1e290), rel=1e-12, nan_ok=True)
        assert self.unpacked(data) == close

    def test_stand_in_a_script_whatever_the_texts_are(self) -> None:
        written = script_json({"a": "</script><!--&\u2028", "n": 1.5})
        assert not set("<>&\u2028") & set(written)
        assert json.loads(written) == {"a": "</script><!--&\u2028", "n": 1.5}


@pytest.mark.parametrize(
    ("part", "of", "said"),
    [
        (0, 5, "0 %"),
        (5, 5, "100 %"),
        (1, 3, "33.3 %"),
        (999_999, 1_000_000, "> 99.9 %"),
        (1, 1_000_000, "< 0.1 %"),
        (0, 0, "0 %"),
        (9995, 10_000, "> 99.9 %"),
    ],
)
def test_a_share_is_all_or_none_only_where_it_is(part: int, of: int, said: str) -> None:
    assert share(part, of) == said


def test_what_cannot_be_seen_is_shown() -> None:
    assert visible("a\x00b\u202ec\nd\u2028") == "a\\x00b\\u202ec\nd\\u2028"
    assert text('<b a="1">') == "&lt;b a=&quot;1&quot;&gt;"
    made = el("p", "<", el("b", "x"), None, cls='"', hidden=True, title=None)
    assert made == '<p class="&quot;" hidden>&lt;<b>x</b></p>'


@pytest.mark.parametrize("paper", ["light", "dark"])
@pytest.mark.parametrize("ink", ["ink", "muted", "accent", "attend", "good"])
@pytest.mark.parametrize("ground", ["paper", "soft"])
def test_words_stand_out_from_what_they_are_on(paper: str, ink: str, ground: str) -> None:
    css = (inlined.FOLDER / "report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root \{(.*?)\}", css, re.DOTALL)
    colours = dict(re.findall(r"--([\w-]+): #([0-9a-f]{6});", light if paper == "light" else dark))

    def brightness(name: str) -> float:
        parts = [int(colours[name][at : at + 2], 16) / 255 for at in (0, 2, 4)]
        red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    low, high = sorted((brightness(ink), brightness(ground)))
    assert (high + 0.05) / (low + 0.05) >= 4.5  # WCAG 2.2, 1.4.3
