"""Files of motors to buy: what is shipped is whole, and what others write is asked of every figure."""

from __future__ import annotations

from pathlib import Path

import pytest

from hw.motor_parts import FIGURES, MOST_BYTES, parts_list
from met.diagnostic import Problem
from met.messages.render import render

MINE = """
[[motor]]
name = "mine"
torque_rated = "80 mN*m"
rate_max = "3000 rpm"
inertia = "120 g*cm^2"
source = "its sticker"

[[bench]]
name = "two of mine"
drive = "mine"
load = "mine"
"""


def complained(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(Problem) as found:
        parts_list(path)
    return render(found.value.diagnostics, found.value.sources)


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "marked.toml").write_text(MINE, encoding="utf-8-sig")
    assert "mine" in parts_list(tmp_path / "marked.toml").motors
    assert complained(tmp_path / "wrong.toml", "\ufeff[[motor]]\nnam = 1\n").splitlines()[1].endswith("wrong.toml:2:1")


def test_every_motor_that_is_shipped_has_a_source_and_what_a_verdict_needs() -> None:
    listed = parts_list()
    assert set(listed.benches) == {"small", "medium", "industrial"}
    for motor in listed.motors.values():
        assert motor.source.startswith("https://")
        assert {"torque_rated", "rate_max", "kt", "inertia"} <= set(motor.figures)
        assert motor.figure("torque_peak") or (motor.figure("resistance") and motor.figure("voltage"))
    for bench in listed.benches.values():
        drive, load = listed.motor(bench.drive), listed.motor(bench.load)
        assert load.figures["torque_rated"] >= drive.figures["torque_rated"]


def test_figures_of_a_motor_agree_with_one_another() -> None:
    """Rated torque is the torque constant times the rated current, to the digits of a data sheet and its friction: so a
    figure that was copied wrong shows."""
    for motor in parts_list().motors.values():
        if motor.figure("current_rated"):
            by_current = motor.figures["kt"] * motor.figures["current_rated"]
            assert motor.figures["torque_rated"] == pytest.approx(by_current, rel=0.13), motor.name


def test_figures_are_si_and_a_file_of_one_s_own_goes_before(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(MINE, encoding="utf-8")
    listed = parts_list(tmp_path / "mine.toml")
    mine = listed.motor("mine")
    assert next(iter(listed.motors)) == "mine"
    assert mine.figures["torque_rated"] == 0.08
    assert mine.figures["rate_max"] == pytest.approx(314.159265, rel=1e-8)
    assert mine.figures["inertia"] == pytest.approx(1.2e-5, rel=1e-15)
    assert mine.figure("kt") is None
    assert listed.benches["two of mine"].load == "mine"
    (tmp_path / "mine.toml").write_text(MINE.replace('"mine"', '"maxon-353297"'), encoding="utf-8")
    assert parts_list(tmp_path / "mine.toml").motor("maxon-353297").figures["torque_rated"] == 0.08


def test_what_a_bench_needs_besides_has_a_kind_and_a_source(tmp_path: Path) -> None:
    kinds = {each.kind for each in parts_list().others.values()}
    assert kinds == {"amplifier", "drive", "supply", "brake resistor", "encoder", "coupling", "CAN adapter"}
    assert all(each.source.startswith("https://") and each.note for each in parts_list().others.values())
    path = tmp_path / "mine.toml"
    path.write_text(MINE + '[[part]]\nname = "box"\nkind = "supply"\nsource = "the shelf"\n', encoding="utf-8")
    assert parts_list(path).others["box"].kind == "supply"
    said = complained(path, MINE + '[[part]]\nname = "box"\nsource = "the shelf"\n')
    assert said.splitlines()[0] == "error[E441]: part number 1 has no `kind`"
    assert "a part has no `kindd`" in complained(path, MINE + '[[part]]\nname = "box"\nkindd = "x"\nsource = "y"\n')
    twice = '[[part]]\nname = "box"\nkind = "x"\nsource = "y"\n'
    assert "part `box` is there twice" in complained(path, MINE + twice + twice)


@pytest.mark.parametrize(
    ("was", "put", "message", "line"),
    [
        ('"80 mN*m"', '"80 mNm"', "`torque_rated` is no quantity above zero in N*m: '80 mNm'", 4),
        ('"80 mN*m"', '"80 W"', "`torque_rated` is no quantity above zero in N*m: '80 W'", 4),
        ('"80 mN*m"', '"-80 mN*m"', "`torque_rated` is no quantity above zero in N*m: '-80 mN*m'", 4),
        ('"80 mN*m"', '"0 mN*m"', "`torque_rated` is no quantity above zero in N*m: '0 mN*m'", 4),
        ('"80 mN*m"', '"1e999 N*m"', "`torque_rated` is no quantity above zero in N*m: '1e999 N*m'", 4),
        ('"80 mN*m"', "0.08", "`torque_rated` is no quantity above zero in N*m: 0.08", 4),
        ("torque_rated", "torque_ratet", "a motor has no `torque_ratet`", 4),
        ('source = "its sticker"', "", "motor number 1 has no `source`", 2),
        ('name = "mine"', "name = 3", "`name` of motor number 1 is no text in a line", 3),
        ('"its sticker"', '"a\\u001b[31m"', "`source` of motor number 1 is no text in a line", 7),
        ('"its sticker"', '"""a\nb"""', "`source` of motor number 1 is no text in a line", 7),
        ('load = "mine"', 'load = "yours"', "bench `two of mine`: there is no motor `yours` in this file", 12),
        ("[[bench]]", "[[benches]]", "no `benches` belongs here", 9),
        ("[[motor]]", "[motor]", "`motor` is no list of tables", 2),
        ("[[motor]]", "part = [3]\n[[motor]]", "`part` is no list of tables", 2),
        ("[[bench]]", '[[motor]]\nname = "mine"\nsource = "x"\n[[bench]]', "motor `mine` is there twice", 9),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_its_line(
    tmp_path: Path, was: str, put: str, message: str, line: int
) -> None:
    path = tmp_path / "mine.toml"
    said = complained(path, MINE.replace(was, put, 1))
    first, second = said.splitlines()[:2]
    assert (first, second.strip()) == (f"error[E441]: {message}", f"--> {path}:{line}:1")
    assert " = help: " in said


def test_a_whole_message_has_line_cause_and_remedy(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    said = complained(path, MINE.replace("rate_max", "rate_maks"))
    known = ", ".join(("name", "maker", "model", "source", "note", *FIGURES))
    assert said == (
        "error[E441]: a motor has no `rate_maks`\n"
        f" --> {path}:5:1\n"
        "  |\n"
        '5 | rate_maks = "3000 rpm"\n'
        "  | ^^^^^^^^^^^^^^^^^^^^^^\n"
        "  = help: did you mean `rate_max`?\n"
        f"  = help: a motor has {known}\n"
        "\n"
        "1 error\n"
    )


def test_what_is_no_toml_or_no_text_is_told(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert f" --> {path}:2:6\n" in complained(path, "\nname mine\n")
    path.write_bytes(b"name = \xff")
    with pytest.raises(Problem, match="is no text in UTF-8"):
        parts_list(path)
    assert "E441" in complained(path, "a = " + "[" * 5000)


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(b"#" * (MOST_BYTES + 1))
    with pytest.raises(OSError, match=r"it has more than [0-9,]+ bytes"):
        parts_list(path)


def test_a_motor_that_is_not_there_is_told_with_what_may_be_meant() -> None:
    with pytest.raises(Problem, match="no motor `pitman-14203s010`") as found:
        parts_list().motor("pitman-14203s010")
    assert found.value.diagnostics[0].help[0] == "did you mean `pittman-14203s010`?"
