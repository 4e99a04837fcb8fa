"""`met doc` beyond models: shapes, motors on beds, units, codes of messages."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ic.meaning.shapes import SHAPES
from ic.printing import codes
from met import cli, models, units


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["doc", *words]) == 0
    return capsys.readouterr().out


def complained(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["doc", *words]) == 2
    return capsys.readouterr().err


def test_every_shape_has_its_sizes(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "shapes")
    for name, shape in SHAPES.items():
        rows = out.split(f"\n\n{name}\n")[1].split("\n\n")[0].splitlines()[1:]
        assert [row.split()[0] for row in rows] == [parameter.name for parameter in shape.parameters]
    assert "extend along one of its axes" in out
    assert [each["name"] for each in json.loads(printed(capsys, "shapes", "--format", "json"))] == list(SHAPES)


def test_substitute_says_its_keys_defaults_models_and_what_is_the_servos(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "substitute")
    assert "\nbeds; emulated unless written\n" in out and "\nlaws; velocity_tracking unless written\n" in out
    assert all(f"\n  {name} " in out for kind in ("bed", "law") for name in models.find_own(kind))
    assert "the servo's j_m " in out
    assert [each["key"] for each in json.loads(printed(capsys, "substitute", "--format", "json"))] == ["bed", "law"]


def test_units_lists_them_all_with_what_they_are_in_si(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {line.split()[0]: line.split() for line in printed(capsys, "units").splitlines() if line.startswith("  ")}
    assert set(units.UNITS) <= set(rows)
    assert rows["km"] == ["km", "kilometre", "1000", "m"] and rows["rpm"][-2:] == ["0.10472", "rad/s"]


def test_the_list_of_models_ends_with_what_else_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys).endswith(
        "Also: dh, shapes, substitute, units; and the code of a message, as in `met doc D060`.\n"
    )


ENTRY = """\
# A page

### D060: a unit is needed

A number where a [dimension](deck.md) belongs.
<!-- deck.ic (text)
hidden
-->
```c
let a = 1;
```

```text
error[D060]: no
```

## Another section

### D061: another
"""


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "diagnostics.md"
    path.write_text(ENTRY)
    monkeypatch.setattr(codes, "PAGE", path)
    return path


def test_a_code_is_explained_by_its_entry_on_the_page(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "d060") == """\
D060: a unit is needed

A number where a dimension belongs.

    let a = 1;

    error[D060]: no
"""
    assert printed(capsys, "D061") == "D061: another\n"


def test_a_code_without_an_entry_or_a_page_is_told(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert complained(capsys, "D062") == """\
error[D171]: no message has the code `D062`, or none that needs an entry
 = help: did you mean `D061`?
 = help: a code is printed with its message, as in `error[D060]`

1 error
"""
    page.unlink()
    assert complained(capsys, "D060") == """\
error[D171]: the page that explains `D060` is not installed with MET
 = help: the entry of every code is in docs/diagnostics.md of a checkout

1 error
"""


def test_the_page_of_this_checkout_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "D060").startswith("D060: ")
