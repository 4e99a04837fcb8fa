"""The page on drives has a bench file that is one, and its figures are those of the code."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from hw.drives import DIALECTS
from hw.drives.bench_file import FIGURES, two_drives
from hw.drives.drive import CanFrame
from hw.drives.odrive_lines import on_lines
from hw.drives.side import APART, SKEW
from tests.hw.players import PLAYED

PAGE = (Path(__file__).parents[2] / "docs" / "drives.md").read_text()


def test_its_bench_file_is_one_and_names_every_figure(tmp_path: Path) -> None:
    (text,) = re.findall(r"<!-- bench\.toml -->\n```toml\n(.*?)```", PAGE, re.S)
    path = tmp_path / "bench.toml"
    path.write_text(text)
    bench = two_drives(path)
    assert bench.name == "bench-1" and bench.load.sense == -1
    for table, figures in FIGURES.items():
        for key in figures:
            assert re.search(rf"^{key}\s*=", text, re.M), (table, key)


def test_its_bench_on_serial_lines_is_one_with_the_other_keys_of_that(tmp_path: Path) -> None:
    whole, serial = (
        tomllib.loads(re.findall(rf"<!-- {name}\.toml -->\n```toml\n(.*?)```", PAGE, re.S)[0])
        for name in ("bench", "serial")
    )
    whole["bus"] = serial["bus"]
    for role in ("drive", "load"):
        del whole[role]["node"], whole[role]["endpoints"]
        whole[role] |= serial[role]
    name = whole.pop("name")
    tables = (
        f"[{table}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
        for table, keys in whole.items()
    )
    path = tmp_path / "bench.toml"
    path.write_text(f'name = "{name}"\n' + "".join(tables))
    bench = two_drives(path)
    assert bench.drive.port.endswith("ODrive_1-if00") and bench.load.port.endswith("ODrive_2-if00")


def test_it_says_how_fast_serial_lines_are() -> None:
    texts = (b"c 0 -0.1234567", b"f 0", b"r axis0.current_state", b"-1000.000000 -1000.000000", b"16777216")
    frames = [CanFrame(1, text) for text in texts]
    assert on_lines(frames, None) == 1.6e-3 and "estimated as 1.6 ms over USB, 500 Hz" in PAGE
    assert on_lines(frames, 921600) == pytest.approx(1.5e-3, rel=0.01) and "1.5 ms an exchange" in PAGE
    accelerated = (0.4 + 3.0 * 0.06) / 1.3e-4
    assert accelerated * (SKEW + 0.55e-3) == pytest.approx(3.3, abs=0.05) and "3.3 rad/s" in PAGE


def test_it_has_every_dialect_and_each_is_played() -> None:
    assert set(DIALECTS) == set(PLAYED)
    assert all(f"`{dialect}`" in PAGE for dialect in DIALECTS)


def test_it_says_what_two_answers_may_differ_by() -> None:
    assert f"within {1e3 * APART:g} ms" in PAGE and f"{1e3 * SKEW:g} ms" in PAGE
    accelerated = (0.4 + 3.0 * 0.06) / 1.3e-4
    assert accelerated * (SKEW + 135e-6) == pytest.approx(1.5, rel=0.01) and "1.5 rad/s" in PAGE


def test_its_first_lines_say_what_was_never_run() -> None:
    assert "nothing on this page was run on real hardware" in "\n".join(PAGE.splitlines()[:6]).replace("\n", " ")
