"""What a picture is written as, and what is never written over."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import pytest

from batch.plotting import draw, plot
from batch.plotting.layout import sheet
from met.diagnostic import Problem
from met.messages.render import render
from tests.batch.plotting.pictures import archive

pytestmark = pytest.mark.usefixtures("engine")

BEGINS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.mark.release
@pytest.mark.parametrize("ending", BEGINS)
def test_the_ending_says_the_format_and_the_same_archive_gives_the_same_bytes(here: Path, ending: str) -> None:
    with archive(3) as file:
        first = draw(file, f"a{ending}").read_bytes()
        assert first.startswith(BEGINS[ending])
        assert draw(file, f"a{ending}").read_bytes() == first  # over its own
        assert draw(file, f"b{ending.upper()}").read_bytes() == first
    assert not re.search(rb"CreationDate|<dc:date>", first)


@pytest.mark.release
def test_letters_of_an_svg_are_drawn_and_those_of_a_pdf_are_letters(here: Path) -> None:
    with archive(3) as file:
        drawn = draw(file, "a.svg").read_text(encoding="utf-8")
        assert "<text" not in drawn and "<!-- time  (s) -->" in drawn
        assert b"/FontFile2" in draw(file, "a.pdf").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("output", "said"),
    [
        ("a.jpg", "error[E326]: cannot write a.jpg: pictures are PNG, SVG or PDF files\n = help: `-o a.png`\n"),
        (
            "folder.png",
            "error[E305]: cannot write folder.png: it is a folder\n"
            " = help: name a file in it: `-o folder.png/plot.png`\n",
        ),
        ("no/a.png", "error[E305]: cannot write no/a.png: no does not exist\n = help: make it first: `mkdir -p no`\n"),
        *(
            (
                f"photo{ending}",
                f"error[E305]: photo{ending} exists and was not drawn by MET: it is not written over\n"
                " = help: give another name with `-o`, or remove the file\n",
            )
            for ending in BEGINS
        ),
    ],
)
def test_a_picture_that_cannot_be_written(here: Path, output: str, said: str) -> None:
    (here / "folder.png").mkdir()
    for ending, begins in BEGINS.items():
        (here / f"photo{ending}").write_bytes(begins + b"\r\n\x1a\nholiday")
    with archive(1) as file, pytest.raises(Problem) as caught:
        draw(file, output)
    assert render(caught.value.diagnostics).rpartition("\n1 error")[0] == said
    assert not list(here.glob(".*.tmp"))


@pytest.mark.slow
def test_a_full_disk_leaves_the_picture_that_was_there(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    def full(self: object, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with archive(1) as file:
        before = draw(file, "a.png").read_bytes()
        monkeypatch.setattr(FigureCanvasAgg, "print_png", full)
        with pytest.raises(Problem) as caught:
            draw(file, "a.png")
    assert caught.value.diagnostics[0].message == "cannot write a.png: no space left on device"
    assert (here / "a.png").read_bytes() == before and not list(here.glob(".*.tmp"))


# On paper


@pytest.mark.parametrize(
    ("text", "inches"),
    [
        ("8.5cm", (8.5 / 2.54, None)),
        ("85 mm x 60 mm", None),
        ("85x60mm", (85 / 25.4, 60 / 25.4)),
        ("6.5in", (6.5, None)),
        (" 8.5 × 6 cm", (8.5 / 2.54, 6 / 2.54)),
    ],
)
def test_a_size_is_a_width_or_both_sides(text: str, inches: tuple[float, float | None] | None) -> None:
    if inches is not None:
        assert (sheet(text).width, sheet(text).height) == pytest.approx(inches)
        return
    with pytest.raises(Problem) as caught:
        sheet(text)
    assert caught.value.diagnostics[0].message == f"size `{text}` cannot be read"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "dpi", "said"),
    [
        (
            "8,5x6",
            None,
            "error[E392]: size `8,5x6` cannot be read\n"
            " = help: as `--size 8.5cm`, a column's width, or `--size 8.5x6cm`; in cm, mm or in\n",
        ),
        (
            "8.5x2cm",
            None,
            "error[E392]: size `8.5x2cm`: sides are from 4 cm to 120 cm\n"
            " = help: as `--size 8.5cm`, a column's width, or `--size 8.5x6cm`; in cm, mm or in\n",
        ),
        ("", 5, "error[E392]: 5 dots per inch: they are from 30 to 2400\n = help: `--dpi 600`\n"),
        (
            "8.5x4cm",
            None,
            "error[E392]: 8.5 x 4 cm have no room for 4 panels, with what is written on them\n"
            " = help: a larger `--size`, or its width alone: the height is then what is needed\n"
            " = help: name fewer to draw\n",
        ),
    ],
)
def test_a_size_that_cannot_be(here: Path, size: str, dpi: int | None, said: str) -> None:
    archive(1)
    with pytest.raises(Problem) as caught:
        plot("a.h5", size=size, dpi=dpi)
    assert render(caught.value.diagnostics).rpartition("\n1 error")[0] == said


@pytest.mark.slow
def test_paper_has_its_size_its_letters_and_no_title(here: Path, figures: list[Any]) -> None:
    from PIL import Image

    archive(3)
    plot("a.h5", "a.png", ["qd"], size="8.5x6cm", dpi=600)
    with Image.open(here / "a.png") as picture:
        assert picture.size == (int(8.5 / 2.54 * 600), int(6 / 2.54 * 600))
    plot("a.h5", "b.svg", ["qd"], size="8.5cm")
    assert f'width="{8.5 / 2.54 * 72:.6f}'[:12] in (here / "b.svg").read_text(encoding="utf-8")
    sizes = {
        text.get_fontsize()
        for text in figures[1].findobj(lambda each: hasattr(each, "get_fontsize"))
        if text.get_text() and text.get_visible()
    }
    assert sizes == {8.0}
    assert figures[1].get_suptitle() == "3 cases"


@pytest.mark.release
@pytest.mark.parametrize("width", ["8.5cm", "17.5cm"])
@pytest.mark.parametrize(
    ("cases", "histories", "over"),
    [
        (1, "all", ()),
        (3, "all", ()),
        (40, "all", ()),
        (40, "none", ()),
        (40, "none", ("gearbox.kp", "links.lower.mass")),
    ],
)
def test_nothing_that_is_written_lies_on_another_or_outside(
    here: Path,
    figures: list[Any],
    monkeypatch: pytest.MonkeyPatch,
    width: str,
    cases: int,
    histories: str,
    over: tuple[str, ...],
) -> None:
    from matplotlib.text import Text

    boxes: dict[Text, Any] = {}
    real = Text.draw

    def drawn(self: Text, renderer: Any) -> None:
        if self.get_visible() and self.get_text().strip():
            boxes[self] = self.get_window_extent(renderer)
        real(self, renderer)

    archive(cases, histories)
    monkeypatch.setattr(Text, "draw", drawn)
    plot("a.h5", "a.png", size=width, over=over)
    assert len(boxes) > 8
    right, top = figures[0].bbox.max
    for text, box in boxes.items():
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= right + 1 and box.y1 <= top + 1, text
    for (text, box), (other, there) in itertools.combinations(boxes.items(), 2):
        across = min(box.x1, there.x1) - max(box.x0, there.x0)
        up = min(box.y1, there.y1) - max(box.y0, there.y0)
        assert across <= 1 or up <= 1, (text, other)
