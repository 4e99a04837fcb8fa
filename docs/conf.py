"""The settings of the site that `scripts/docs` builds from README.md, docs/ and the docstrings of the public modules.

The pages are plain Markdown that reads as well where the repository is shown. What a site needs besides, the order of
its pages and the modules of the API, stands here.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from met.version import VERSION  # noqa: E402  (only once the checkout is on the path)

# In the order in which a user needs them; the headings stand in the sidebar.
PAGES = {
    "Begin": ["README", "install", "tutorial"],
    "Decks": ["deck", "loops", "coupled", "booms", "editions", "robots", "servos", "environments", "models",
              "substitution", "reference", "diagnostics", "editors"],
    "Campaigns and results": ["cluster", "best", "search", "verification", "evidence", "sensitivity", "linear", "plots",
                              "report", "diff", "residuals", "fit", "export", "webassembly", "fmu",
                              "notebooks"],
    "A motor on a bed": ["bed", "bench", "drives", "pico", "pico_safety", "protocol", "../hw/firmware/README"],
    "From Python": ["python", "api"],
    "What it computes": ["physics", "paper", "engine"],
    "Inside": ["architecture", "glossary", "../CONTRIBUTING", "../SECURITY", "../CHANGELOG"],
}  # fmt: skip
MODULES = [
    "ic", "batch", "batch.simulation.simulation", "batch.simulation.stepping", "met.diagnostic", "met.parameter",
    "met.trace", "met.servos.servo", "met.environments.environment", "met.sensors.sensor", "met.metrics.metric",
    "met.integrators.integrator", "met.guides.guide", "met.substitution.law", "met.substitution.bed",
]  # fmt: skip
"""Public modules, which docs/api.md shows: what a script calls, then what a model of one's own imports."""

project = "MET"
release = VERSION
extensions = ["myst_parser", "sphinx.ext.autodoc"]
include_patterns = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "docs/*.md", "hw/firmware/README.md"]
root_doc = "README"
source_suffix = {".md": "markdown"}
html_theme = "furo"
html_title = f"MET {VERSION}"
html_static_path = ["site"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
myst_heading_anchors = 6
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
maximum_signature_line_length = 80
autodoc_preserve_defaults = True
default_role = "code"
highlight_language = "none"
suppress_warnings = ["misc.highlighting_failure"]  # decks are shown as C, which knows no `N·m`


def add_what_a_site_needs(app: Any, page: str, source: list[str]) -> None:
    """Append the sidebar's order to the README and the modules to the page of the API."""
    if page == root_doc:
        for caption, names in PAGES.items():
            paths = "\n".join(f"docs/{name}" for name in names).replace("docs/../", "")
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n:maxdepth: 1\n\n{paths}\n```\n"
    if page == "docs/api":
        for module in MODULES:
            exported = "   :imported-members:\n" if module == "met.trace" else ""
            shown = f".. automodule:: {module}\n   :members:\n{exported}"
            source[0] += f"\n## `{module}`\n\n```{{eval-rst}}\n{shown}```\n"


def fields_of_docstrings(app: Any, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """Make a list of a docstring's aligned lines, `name   what it is`; the rest are paragraphs."""
    made: list[str] = []
    before = ""  # the kind of the line before: a field, what belongs to it, text, or nothing
    for line in (line.replace("|", r"\|").rstrip() for line in lines):
        field = re.match(r"([\w\[][\w\[\]., /*()-]*?) {2,}(\S.*)$", line)
        kind = "field" if field else "" if not line else "rest" if line[0] == " " and before == "field" else "text"
        if before and kind != "rest" and (kind == "field") != (before == "field"):
            made.append("")
        made.append(f":{field[1]}: {field[2]}" if field else line if kind == "rest" else line.strip())
        before = "field" if kind == "rest" else kind
    lines[:] = made


def begin_with_the_readme(app: Any, failure: Exception | None) -> None:
    """Make the README the site's first page, index.html, too."""
    home = Path(app.outdir, "README.html")
    if home.exists():
        shutil.copyfile(home, home.with_name("index.html"))


def setup(app: Any) -> None:
    app.connect("build-finished", begin_with_the_readme)
    app.connect("source-read", add_what_a_site_needs)
    app.connect("autodoc-process-docstring", fields_of_docstrings)
