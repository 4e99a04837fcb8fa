"""Pages of docs show what their commands print."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import Page, differs


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("bed", 6),
        ("bench", 4),
        ("best", 5),
        ("booms", 5),
        ("coupled", 4),
        ("environments", 1),
        ("evidence", 2),
        ("fit", 9),
        ("linear", 15),
        ("residuals", 6),
        ("search", 8),
        ("sensitivity", 2),
    ],
)
def test_a_page_shows_what_its_commands_print(name: str, count: int, tmp_path: Path) -> None:
    page = Page(f"{name}.md")
    assert len(page.shown) == count
    for command, shown, said in page.follow(tmp_path):
        assert not shown or not differs(shown, said), f"met {command}"
        for word in command.split():
            assert Path(word).suffix not in (".png", ".h5") or (tmp_path / word).stat().st_size > 10_000


def test_what_is_shown_with_gaps_is_compared_piece_by_piece() -> None:
    said = "a (3 KiB)\nb\nc\nd\n"
    assert not differs(said, said) and not differs("a (4 KiB)\n...\nd\n", said) and not differs("...\nc\n...\n", said)
    assert differs("b\n...\n", said) == "b\n"
    assert differs("...\nd\n...\nb\n", said) == "b\n"
    assert differs("a (3 KiB)\nb\n", said) == "(also said) c\nd\n"
