"""`met fmt`: which files, what is written, what is said, and the exit status."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path

import pytest

from met import cli

LOOSE = "arm bar{\nlink rod{mass=2kg;}\n}\n"
LAID = "arm bar {\n    link rod { mass = 2 kg; }\n}\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fmt(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = cli.main(["fmt", *words])
    return (status, *capsys.readouterr())


def test_a_deck_is_laid_out_in_its_place_and_the_second_time_there_is_nothing_to_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("a.ic").write_text(LOOSE)
    assert fmt(capsys, "a.ic") == (0, "a.ic: formatted\n", "")
    assert Path("a.ic").read_text() == LAID
    written = Path("a.ic").stat().st_mtime_ns
    assert fmt(capsys, "a.ic") == (0, "", "")
    assert fmt(capsys, "a.ic", "-v") == (0, "a.ic: as it should be\n", "")
    assert Path("a.ic").stat().st_mtime_ns == written


def test_check_writes_nothing_and_says_no_where_a_deck_would_change(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text(LOOSE)
    Path("b.ic").write_text(LAID)
    assert fmt(capsys, "--check", "a.ic", "b.ic") == (1, "a.ic: would be formatted\n", "")
    assert fmt(capsys, "--check", "b.ic") == (0, "", "")
    assert fmt(capsys, "--check", "-q", "a.ic") == (1, "", "")
    assert Path("a.ic").read_text() == LOOSE


def test_diff_prints_what_would_change_and_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text("let a = 1;\nlet b=2;")
    shown = """\
--- a.ic
+++ a.ic (formatted)
@@ -1,2 +1,2 @@
 let a = 1;
-let b=2;
\\ No newline at end of file
+let b = 2;
"""
    assert fmt(capsys, "--diff", "a.ic") == (0, shown, "")
    assert fmt(capsys, "--diff", "--check", "a.ic") == (1, shown, "a.ic: would be formatted\n")
    assert Path("a.ic").read_text() == "let a = 1;\nlet b=2;"


def test_of_a_folder_all_decks_are_taken_but_for_hidden_folders(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("in/one.ic", "in/deep/two.ic", "in/.git/three.ic", "in/notes.txt"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(LOOSE)
    assert fmt(capsys, "in") == (0, "in/deep/two.ic: formatted\nin/one.ic: formatted\n", "")
    assert Path("in/.git/three.ic").read_text() == Path("in/notes.txt").read_text() == LOOSE


def test_a_folder_without_decks_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    Path("empty").mkdir()
    assert fmt(capsys, "empty") == (
        2,
        "",
        """\
error[E341]: there is no deck in the folder `empty`
 = help: a deck's name ends in `.ic`; a file of another name is formatted where it is named

1 error
""",
    )


def test_a_broken_deck_stays_and_the_others_are_laid_out(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text("a{ b=1;\n")
    Path("b.ic").write_text(LOOSE)
    status, out, err = fmt(capsys, ".")
    assert (status, out) == (2, "b.ic: formatted\n")
    assert err.startswith("error[D022]: this `{` is not closed\n --> a.ic:1:2\n")
    assert Path("a.ic").read_text() == "a{ b=1;\n"


@pytest.mark.parametrize(("name", "data", "code"), [
    ("none.ic", None, "D001"), ("a.ic", b"let a = \xff;", "D002"), ("a.ic", b"\x89HDF\r\n\x1a\n\0", "D002"),
    ("plan.json", b"{}", "E342"),
])  # fmt: skip
def test_what_is_no_deck_is_refused(
    name: str, data: bytes | None, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if data is not None:
        Path(name).write_bytes(data)
    status, out, err = fmt(capsys, name)
    assert (status, out) == (2, "") and err.startswith(f"error[{code}]: ")
    assert data is None or Path(name).read_bytes() == data


def test_lines_end_with_a_newline_alone_and_that_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_bytes(b"\xef\xbb\xbf" + LAID.replace("\n", "\r\n").encode())
    assert fmt(capsys, "a.ic") == (0, "a.ic: formatted; its lines end with a newline alone\n", "")
    assert Path("a.ic").read_bytes() == LAID.encode()


def test_permissions_and_links_stay_and_nothing_is_left_beside(capsys: pytest.CaptureFixture[str]) -> None:
    Path("real").mkdir()
    Path("real/a.ic").write_text(LOOSE)
    Path("real/a.ic").chmod(0o640)
    Path("link.ic").symlink_to("real/a.ic")
    assert fmt(capsys, "link.ic")[0] == 0
    assert Path("link.ic").is_symlink() and Path("real/a.ic").read_text() == LAID
    assert stat.S_IMODE(Path("real/a.ic").stat().st_mode) == 0o640
    assert os.listdir("real") == ["a.ic"]


def test_a_link_to_what_is_no_deck_is_not_written_through(capsys: pytest.CaptureFixture[str]) -> None:
    Path("given").mkdir()
    Path("passwords").write_text("root:x:0:0:root:/root\n")
    Path("given/a.ic").symlink_to("../passwords")
    target = Path("passwords").resolve()
    for path in ("given", "given/a.ic"):
        status, _, complaint = fmt(capsys, path)
        assert status == 2 and complaint == (
            f"error[E338]: cannot write `given/a.ic`: it is a link to `{target}`\n"
            f" = help: links are followed to `.ic` files alone; `met fmt {target}` names the file itself\n"
            "\n1 error\n"
        )
    assert Path("passwords").read_text() == "root:x:0:0:root:/root\n"


def test_from_standard_input_to_standard_output(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def type_in(text: str) -> None:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))

    type_in(LOOSE)
    assert fmt(capsys, "-") == (0, LAID, "")
    type_in(LOOSE)
    assert fmt(capsys, "-", "--check") == (1, "", "")
    type_in("a {")
    status, out, err = fmt(capsys, "-")
    assert (status, out) == (2, "") and " --> <stdin>:1:3\n" in err
    status, out, err = fmt(capsys, "-", "a.ic")
    assert (status, out) == (2, "") and "`-` stands alone" in err


def test_a_macro_of_an_included_file_that_makes_strings_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    Path("parts").mkdir()
    Path("parts/said.ic").write_text('#include "more.ic"\n')
    Path("parts/more.ic").write_text("#define SAID(X) file = #X\n")
    Path("a.ic").write_text('#include "parts/said.ic"\na { SAID(b  .c); }\nd=e;\n')
    fmt(capsys, "a.ic")
    assert Path("a.ic").read_text() == '#include "parts/said.ic"\na { SAID(b  .c); }\nd = e;\n'


def test_a_deck_that_cannot_be_written_stays_and_the_others_are_laid_out(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("a.ic").write_text(LOOSE)
    Path("b.ic").write_text(LOOSE)
    replace = os.replace

    def no_space_for_a(made: str, target: str) -> None:
        if target.endswith("a.ic"):
            raise OSError(28, os.strerror(28))
        replace(made, target)

    monkeypatch.setattr("os.replace", no_space_for_a)
    assert fmt(capsys, ".") == (
        2,
        "b.ic: formatted\n",
        """\
error[E338]: cannot write `a.ic`: no space left on device
 = help: it is as it was; what takes its place is written beside it, so its folder must allow that

1 error
""",
    )
    assert Path("a.ic").read_text() == LOOSE and sorted(os.listdir()) == ["a.ic", "b.ic"]


def test_a_file_that_is_named_twice_is_one_deck(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text(LOOSE)
    Path("link.ic").symlink_to("a.ic")
    assert fmt(capsys, "--check", "a.ic", "./a.ic", ".") == (1, "a.ic: would be formatted\n", "")


def test_a_folder_that_cannot_be_looked_into_is_told(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("in/locked").mkdir(parents=True)
    Path("in/a.ic").write_text(LOOSE)
    look = os.scandir

    def refuse(path: str) -> object:
        if path.endswith("locked"):
            raise PermissionError(13, os.strerror(13), path)
        return look(path)

    monkeypatch.setattr("os.scandir", refuse)  # for root there is no folder that it may not see
    assert fmt(capsys, "in") == (2, "", "error[E338]: `in/locked`: Permission denied\n\n1 error\n")
    assert Path("in/a.ic").read_text() == LOOSE


def test_standard_input_that_is_closed_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", None)
    assert fmt(capsys, "-") == (
        2,
        "",
        """\
error[D001]: cannot read standard input: it is closed
 = help: name a deck, or pipe one in

1 error
""",
    )
