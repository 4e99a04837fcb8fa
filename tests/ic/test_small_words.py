"""Remedies that are followed as they are written, and one message of one mistake, where a second used to follow."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.printing.explain import find_paths
from met.diagnostic import Problem
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment


def test_of_a_rate_that_is_refused_no_steps_are_counted(tmp_path: Path) -> None:
    run = changed(RUN, ("dynamics = 1 kHz; servos", "base = 1 kHz; dynamics = 300 Hz; servos"))
    assert codes(tmp_path, ARM, SERVO, run) == ["D100"]


@pytest.mark.parametrize("text", [
    "#ifdfe X\n#endif\n", "#iff 1\n#else\n#endif\n", "#ifdef Y\n#endif\n#ifdfe X\n#endif\n",
])  # fmt: skip
def test_a_misspelt_if_is_told_without_its_endif(tmp_path: Path, text: str) -> None:
    assert codes(tmp_path, text, ARM, SERVO, RUN) == ["D007"]


def test_an_endif_too_many_is_told(tmp_path: Path) -> None:
    assert codes(tmp_path, "#ifdfe X\n#endif\n#endif\n", ARM, SERVO, RUN) == ["D007", "D007"]


def test_a_quantity_on_the_command_line_is_told_to_be_set(tmp_path: Path) -> None:
    length = changed(ARM, ("1 m", "LENGTH"))
    (told,) = check(tmp_path, length, SERVO, RUN, defines=["LENGTH=2 m"]).diagnostics
    assert told.code == "D017"
    assert told.help[0].startswith("write `let LENGTH = ...;` in the deck, and `--set 'LENGTH=2 m'`")
    followed = check(tmp_path, "let LENGTH = 1 m;\n", length, SERVO, RUN, set=["LENGTH=2 m"])
    assert followed.plan is not None
    assert not followed.diagnostics


def test_the_code_of_a_message_is_no_parameter_and_has_an_entry(tmp_path: Path) -> None:
    with pytest.raises(Problem) as found:
        find_paths(experiment(tmp_path), "D305")
    assert found.value.diagnostics[0].help == ("`met doc D305` says what this message means",)
