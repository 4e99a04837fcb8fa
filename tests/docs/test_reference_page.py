"""docs/reference.md is what the models declare."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from reference import main, page

from ic.meaning.expressions.evaluate import CONSTANTS
from ic.printing.models import default
from met import models, units
from met.plan import channel

PAGE = (Path(__file__).parents[2] / "docs" / "reference.md").read_text(encoding="utf-8")


def test_the_page_is_up_to_date() -> None:
    assert PAGE.splitlines() == "\n".join(page()).splitlines(), "write it anew: .venv/bin/python scripts/reference.py"


def test_the_script_writes_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reference.FILE", tmp_path / "reference.md")
    main()
    assert (tmp_path / "reference.md").read_text(encoding="utf-8") == PAGE


def test_every_model_parameter_unit_and_channel_is_on_it() -> None:
    for kind in models.GROUPS:
        for name, model in models.find_own(kind).items():
            section = re.search(rf"^### {kind} {name}\n(.*?)(?=^##)", PAGE, re.DOTALL | re.MULTILINE)
            assert section is not None, name
            for parameter in models.written(model):
                assert f"\n| `{parameter.name}` |" in section[1], (name, parameter.name)
    assert all(f"\n| `{name}` |" in PAGE for name in units.ALL_UNITS)
    assert all(f"\n| `{name}` |" in PAGE for name, *_ in channel.OF_ARM)


def test_every_default_unit_and_constant_reads_back_as_what_it_is() -> None:
    for kind in models.GROUPS:
        for name, model in models.find_own(kind).items():
            for parameter in models.written(model):
                if isinstance(parameter.default, float):
                    assert float(default(parameter).split(";")[0]) == parameter.default, (name, parameter.name)
    assert "\n| `mu` | m^3/s^2 | 3.986004418e+14 | > 0 |" in PAGE
    table = PAGE.split("\n## Units\n")[1].split("\n## ")[0]
    for name, unit in units.ALL_UNITS.items():
        (told,) = re.findall(rf"^\| `{re.escape(name)}` \| [^|]* \| (\S+) ", table, re.MULTILINE)
        assert float(told) == unit.measure.scale, name
    for name, value in CONSTANTS.items():
        (told,) = re.findall(rf"^\| `{name}` \| (\S+) \|", PAGE, re.MULTILINE)
        assert float(told) == value, name


def test_its_links_lead_somewhere() -> None:
    headings = {line.lstrip("# ").lower().replace(" ", "-") for line in PAGE.splitlines() if line.startswith("#")}
    assert set(re.findall(r"\]\(#(.*?)\)", PAGE)) <= headings
    assert all((Path(__file__).parents[2] / "docs" / name).is_file() for name in re.findall(r"\]\((\w+\.md)\)", PAGE))


def test_no_table_has_a_row_of_another_width() -> None:
    for table in re.findall(r"(?:^\|.*\n)+", PAGE, re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in table.splitlines()}) == 1, table
