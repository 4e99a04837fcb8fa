"""Visual Studio Code itself, in a browser: what the extension shows there, and what it does when it is asked to.

It takes code-server, which no package of Debian's or Python's brings: where it is not, docs/editors.md says what these
tests found where it was.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.batch.report.browser import browser
from tests.batch.report.browser import program as browser_program
from tests.ic.editor.code_server import CONTROL, PROGRAM, SHIFT, Code, code_server
from tests.ic.editor.test_questions import ARM, LENGTHS

if shutil.which(PROGRAM) is None or browser_program() is None:
    pytest.skip(f"no {PROGRAM}, or no browser", allow_module_level=True)

METRIC = "    metric settle = settling_time { of = elbow.qd;  target = slow; }\n    require settle < 10 s;\n"
DECK = ARM.replace("= 20 s;", "= 20;").replace("record    ", "recrod    ").replace("    allow", f"{METRIC}    allow")
PLACE_OF = "(e => e && (b => [b.left + Math.min(4, b.width / 2), b.top + b.height / 2])(e.getBoundingClientRect()))"
SQUIGGLES, LENSES = "document.querySelectorAll('.squiggly-error').length", ".codelens-decoration"


@pytest.mark.slow
@pytest.mark.browser
def test_vscode_shows_and_mends_mistakes_completes_renames_and_runs(tmp_path: Path) -> None:
    (tmp_path / "lengths.ic").write_text(LENGTHS)
    (tmp_path / "arm.ic").write_text(DECK)
    with code_server(tmp_path) as address, browser() as chromium:
        code = Code(chromium.open(address))
        code.open("arm.ic")
        code.until(f"{SQUIGGLES} === 2")
        code.key("m", CONTROL | SHIFT)
        code.until_text(".markers-panel .monaco-list-row", "help: did you mean `record`?")
        problems = "\n".join(code.texts(".markers-panel .monaco-list-row"))
        assert "a run has no `recrod`" in problems and "is in s, and this is a bare number" in problems
        code.key("m", CONTROL | SHIFT)
        kp, mass, unit = code.colours(["kp", "shape", "rad"])
        assert kp == mass != unit, "a parameter of a model that another file names is a key like any other"
        for left in (1, 0):
            code.page.click(*code.until(f"{PLACE_OF}(document.querySelector('.squiggly-error'))"))
            code.key(".", CONTROL)
            code.until("document.querySelectorAll('.action-widget .monaco-list-row').length")
            code.key("Enter")
            code.until(f"{SQUIGGLES} === {left}")
        assert "record      = [" in code.text() and "= 20 s;" in code.text()
        code.until_text(LENSES, "2 cases")
        code.click("gearbox", 1)
        code.key("F2")
        code.until("(e => e.matches('.rename-box input') && e.value === 'gearbox')(document.activeElement)")
        code.key("a", CONTROL)
        code.write("motor")
        code.key("Enter")
        code.until_in_text("motor.kp")
        assert "servo motor like rigid_gearbox" in code.text() and "gearbox;" not in code.text()
        code.click("gains")
        code.key("End")
        code.key("Enter")
        code.write("sweep more of nominal { vary motor.")
        code.key(" ", CONTROL)
        code.until_text(".suggest-widget .monaco-list-row", "tau_max")
        code.key("Escape")
        code.key("k", CONTROL | SHIFT)
        code.until("!document.querySelector('.view-lines').innerText.includes('more')")
        run = "Array.from(document.querySelectorAll('.codelens-decoration a')).find(e => e.innerText === 'run')"
        code.page.click(*code.until(f"{PLACE_OF}({run})"))
        code.until_text(LENSES, "met by 1 of 1")
        assert (tmp_path / "arm.h5").is_file()
        assert code.page.run("document.querySelectorAll('.terminal-wrapper').length"), "what it printed stays"
