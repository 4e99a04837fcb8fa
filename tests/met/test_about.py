"""`met --version --long`: lines that a report of a defect needs, from every computer that MET starts on."""

from __future__ import annotations

import builtins
import os
import platform
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from met import about, cli
from met.host import provenance, system
from met.version import VERSION


def lines() -> dict[str, str]:
    """What is printed, by the names of the lines."""
    named = [re.fullmatch(r"(\S+(?: \S+)*) +(\S.*)", line) for line in about.about().splitlines()]
    assert all(line is not None and line.start(2) == 11 for line in named), "the texts are below one another"
    return {line[1]: line[2] for line in named if line is not None}


def test_the_command_prints_what_a_report_needs(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version", "--long"]) == cli.YES
    assert capsys.readouterr().out == about.about() + "\n"
    facts = lines()
    assert list(facts) == ["met", "python", "system", "processor", "code for", "libraries", "compiler", "cache"]
    assert facts["met"].startswith(f"{VERSION}, commit ")
    assert facts["python"] == f"CPython {platform.python_version()}, {sys.executable}"
    assert facts["processor"].endswith(f", {system.cores()} of {os.cpu_count()} cores")
    assert re.fullmatch(r".+, [248] doubles at once, (no )?fma; llvmlite \S+ llvm \S+", facts["code for"])
    assert f"numpy {provenance.version('numpy')}, " in facts["libraries"] and "unknown" not in facts["libraries"]


def test_the_order_of_the_options_does_not_matter(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--long", "--version"]) == cli.YES
    assert capsys.readouterr().out.startswith(f"met        {VERSION}, commit ")


def test_the_version_alone_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == cli.YES
    assert capsys.readouterr().out == f"met {VERSION}\n"


@pytest.mark.parametrize("words", [["--long"], ["--long", "check", "two_link.ic"]])
def test_long_alone_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words) == cli.BAD_INPUT
    assert capsys.readouterr().err.endswith("Error: --long is for --version: `met --version --long`\n")


def test_what_a_computer_lacks_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import_module = builtins.__import__

    def without_llvm(name: str, *rest: Any, **words: Any) -> Any:
        if name.startswith("met.backends"):
            raise ImportError("libLLVM.so: cannot open\nshared object file")
        return import_module(name, *rest, **words)

    monkeypatch.setattr(builtins, "__import__", without_llvm)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(system, "cpu", lambda: "")
    monkeypatch.setattr(about, "Revision", lambda: type("Outside", (), {"read": lambda self: ("unknown", "unknown")})())
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path))
    facts = lines()
    assert facts["met"] == f"{VERSION}, commit unknown"
    assert facts["processor"].startswith("unknown, ")
    assert facts["code for"] == "none: libLLVM.so: cannot open shared object file"
    assert facts["compiler"] == "none: there is no `cc`"
    assert facts["cache"] == str(tmp_path)


def test_a_compiler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for text, answer in (("#!/bin/sh\n", "it says nothing"), ("", "[Errno 8] Exec format error: ")):
        (tmp_path / "cc").write_text(text)
        (tmp_path / "cc").chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
        assert lines()["compiler"].startswith(f"{tmp_path / 'cc'}: {answer}")
