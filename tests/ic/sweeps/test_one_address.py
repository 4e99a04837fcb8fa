"""One address for a thing: the paths that `met explain` lists are those that `--set`, `with` and `vary` take."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from ic.driver.explain import with_all_settings
from ic.printing.explain import with_settings
from met.plan import Formula, Quantity
from tests.ic.small_decks import ARM, RUN, SERVO, changed, messages

WHOLE = changed(
    RUN,
    ("servos {", "base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); yaw = 10 deg; };\n    servos {"),
    (
        "record = [q];",
        """record = [q];
    environment { gravity = [0, 0, -9.81] m/s^2; push = wrench(link = bar, force = [0, 1, 0] N); }
    metric top = settling_time { of = hinge.qd; target = 0.1 rad/s; band = 2 %; }
    require top < 1 s;
    initial { hinge.q = 0.1 rad; }""",
    ),
)
SENSED = changed(SERVO, ("command =", "sensor qd = tachometer { noise = 0.01 rad/s; }\n    command ="))


def value_of(quantity: Quantity) -> str:
    if isinstance(quantity.value, str):
        return quantity.value
    assert isinstance(quantity.value, (int, float)), quantity
    unit = "" if quantity.unit in ("1", "") else f" {quantity.unit}"
    return f"({quantity.value!r}){unit}"


@pytest.fixture(scope="module")
def paths() -> tuple[str, dict[str, str]]:
    text = ARM + SENSED + WHOLE
    compiled = ic.check(text=text)
    assert compiled.plan is not None, messages(compiled)
    found = with_settings(with_all_settings(compiled)).parameters
    values = {path: value_of(each) for path, each in found.items() if not isinstance(each.value, (tuple, Formula))}
    assert len(values) > 60 and {"metrics.top.of", "base.x.model", "hinge.servo.kp", "duration"} <= set(values)
    return text, values


def codes(deck: Path, text: str, **options: object) -> set[str]:
    deck.write_text(text, encoding="utf-8")
    return {each.code for each in ic.check(deck, **options).diagnostics if each.severity == "error"}  # type: ignore[arg-type]


@pytest.mark.release
def test_every_path_that_explain_lists_is_known_to_what_sets_values(
    tmp_path: Path, paths: tuple[str, dict[str, str]]
) -> None:
    text, values = paths
    told = {path: codes(tmp_path / "deck.ic", text, set={path: value}) for path, value in values.items()}
    strange = {path: found for path, found in told.items() if "D234" in found}
    assert not strange
    assert sum(not found for found in told.values()) > len(values) // 3


@pytest.mark.release
def test_a_run_and_the_command_line_take_the_same_paths(tmp_path: Path, paths: tuple[str, dict[str, str]]) -> None:
    text, values = paths
    for path, value in values.items():
        if path in ("record", "seed"):  # a list, and what no `with` is of
            continue
        outside = codes(tmp_path / "deck.ic", text, set={path: value})
        inside = codes(
            tmp_path / "deck.ic", f"{text}run other like hold {{ with {path} = {value}; }}\n", select=["other"]
        )
        assert (outside - {"D232"}) == (inside - {"D232"}), path  # beside `duration = 1 s;` a `with` of it is refused


@pytest.mark.slow
def test_a_sweep_knows_every_number_that_explain_lists(tmp_path: Path, paths: tuple[str, dict[str, str]]) -> None:
    text, values = paths
    for path, value in values.items():
        found = codes(tmp_path / "deck.ic", f"{text}sweep all of hold {{ vary {path} = [{value}]; }}\n", select=["all"])
        assert "D128" not in found, path
