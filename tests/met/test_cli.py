"""What holds for every command: how it is found, how it fails, what its exit status says, what it may import."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import click
import pytest

import met_arm
from met import cli
from met.diagnostic import Place, Problem, error
from met.host.entry_points import EntryPoint, offered
from met.host.streams import kept
from met.version import VERSION

ROOT = Path(__file__).parents[2]

BROKEN = """\
arm one {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint pivot revolute { parent = base; child = bar; axis = z; }
}
run swing {
    arm = one;
    rates { dynamics = 1 kHz; }
    duration = 1 s;
    durations = 2 s;
    record = [q];
}
"""


def offer(monkeypatch: pytest.MonkeyPatch, **commands: object) -> None:
    """Let the table hold these commands, as another package would offer them."""

    class Point(EntryPoint):
        def load(self) -> object:
            return commands[self.name]

    points = [Point(name, f"plugin:{name}", "plugin") for name in commands]
    monkeypatch.setattr(cli, "offered", lambda group: points)


def command(function: object) -> click.Command:
    return click.command()(function)  # type: ignore[call-overload, no-any-return]


def met(*words: str, **more: object) -> subprocess.CompletedProcess[str]:
    """`met` in a process of its own, as a user starts it."""
    surroundings = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "met.cli", *words], capture_output=True, text=True, env=surroundings, **more
    )  # type: ignore[call-overload, no-any-return]


def test_help_lists_the_commands_in_groups_and_in_the_order_of_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    lines = capsys.readouterr().out.partition("this message and exit.\n")[2].splitlines()
    headings = [line.removesuffix(":") for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert [each for each in headings if each != cli.OTHERS] == list(cli.GROUPS)
    listed = [line.split()[0] for line in lines if line.startswith("  ") and line[2] not in " S"]
    assert [word for word in listed if word in cli.ORDER] == [word for word in cli.ORDER if word in listed]
    own = {point.name for point in cli.met.table().values() if point.package == "met_arm"}
    assert own <= {*cli.ORDER, "bench"} and listed.index("best") < listed.index("diff")
    assert {"check", "plan", "cases", "explain", "run", "show", "plot", "doc", "dump"} <= set(listed)


def test_every_command_has_a_line_of_help_of_its_own() -> None:
    context = click.Context(cli.met)
    commands = [cli.met.get_command(context, name) for name in cli.met.list_commands(context)]
    helps = [each.get_short_help_str(100) for each in commands if each is not None]
    assert all(helps) and len(set(helps)) == len(helps)
    assert all(not text.endswith("...") for text in helps), helps


def test_the_table_of_setup_cfg_is_what_an_installed_package_says() -> None:
    """In a checkout setup.cfg is read by us, elsewhere what the installer made of it: the same table."""
    setuptools_reads = {}
    from setuptools.config.setupcfg import read_configuration

    for line in read_configuration(ROOT / "setup.cfg")["options"]["entry_points"]["met.commands"]:
        name, _, value = line.partition("=")
        setuptools_reads[name.strip()] = value.strip()
    assert {point.name: point.value for point in offered("met.commands")} == setuptools_reads


def test_another_package_can_offer_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tmp_path / "my_arm-1.0.dist-info"
    made.mkdir()
    table = "[console_scripts]\nx = y:z\n\n[met.commands]\nwave = my_arm.cli:wave\n[other]\na = b:c\n"
    (made / "entry_points.txt").write_text(table)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert EntryPoint("wave", "my_arm.cli:wave", "my_arm") in offered("met.commands")


def test_a_package_that_is_there_twice_offers_its_first_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for place, value in (("late", "old:wave"), ("early", "new:wave")):
        made = tmp_path / place / "my_arm-1.0.dist-info"
        made.mkdir(parents=True)
        (made / "entry_points.txt").write_text(f"[met.commands]\nwave = {value}\n")
        monkeypatch.syspath_prepend(str(tmp_path / place))
    assert [point.value for point in offered("met.commands") if point.name == "wave"] == ["new:wave"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("chek", "met check"), ("plto", "met plot"), ("two_link.ic", "met run two_link.ic")],
)
def test_an_unknown_command_is_answered_with_what_was_meant(
    typed: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([typed]) == cli.BAD_INPUT
    assert f"no command `{typed}`; did you mean `{meant}`?" in capsys.readouterr().err


def test_a_command_says_yes_or_no_by_what_it_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    offer(monkeypatch, yes=command(lambda: None), no=command(lambda: cli.NO))
    assert (cli.main(["yes"]), cli.main(["no"])) == (0, 1)


def test_a_problem_is_rendered_once_on_stderr_and_ends_with_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        found = error("D999", "no such thing", Place("a.ic", 2, 3, 4), help="leave it out")
        raise Problem(found, {"a.ic": "x\n  this\n"})

    offer(monkeypatch, fail=command(fail))
    assert cli.main(["fail"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "error[D999]: no such thing\n --> a.ic:2:3\n  |\n2 |   this\n  |   ^^^^\n  = help: leave it out\n\n1 error\n"
    )


@pytest.mark.slow
def test_with_format_json_a_problem_is_json_on_stdout(tmp_path: Path) -> None:
    (tmp_path / "broken.ic").write_text(BROKEN)
    done = met("check", "broken.ic", "--format", "json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert done.returncode == 2
    assert done.stderr == ""
    assert told["errors"] == 1
    shown = told["diagnostics"][0]["shown"]
    assert (shown["file"], shown["line"], shown["column"]) == ("broken.ic", 9, 5)


def test_wrong_usage_ends_with_2_and_says_how_it_is_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check"]) == 2
    assert capsys.readouterr().err.replace("check -h'", "check --help'") == (  # click before 8.4 names the short option
        "Usage: met check [OPTIONS] DECK...\nTry 'met check --help' for help.\n\nError: Missing argument 'DECK...'.\n"
    )


def test_an_interrupt_ends_with_130_and_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    offer(monkeypatch, stop=command(stop))
    assert cli.main(["stop"]) == 130
    assert capsys.readouterr().err == "\nmet: interrupted\n"


def test_a_defect_is_owned_in_one_paragraph_with_the_traceback_in_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def divide() -> float:
        return 1 / 0

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    offer(monkeypatch, divide=command(divide))
    assert cli.main(["divide"]) == cli.DEFECT
    err = capsys.readouterr().err
    (report,) = tmp_path.glob("met-defect-*.txt")
    assert err == (
        "met: this is a defect of MET, not of what you gave it: ZeroDivisionError: division by zero. "
        f"The traceback is in {report}. "
        "Please report it together with the deck and the command, `met divide`.\n"
    )
    assert report.read_text().startswith(f"met divide\nmet        {VERSION}, commit ")
    assert "return 1 / 0" in report.read_text()


def test_a_file_that_cannot_be_read_is_the_users_to_mend_not_a_defect(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    offer(monkeypatch, read=command(lambda: Path("/no/such/file").read_text()))
    assert cli.main(["read"]) == 2
    assert capsys.readouterr().err == "error[E338]: `/no/such/file`: No such file or directory\n\n1 error\n"


CLOSED = "error[E338]: cannot write the standard output: it is closed\n"


@pytest.mark.release
@pytest.mark.parametrize(("closed", "status", "said"), [("stdout", 2, CLOSED), ("stderr", 0, "")])
def test_a_stream_that_the_shell_has_closed_is_no_defect(closed: str, status: int, said: str) -> None:
    program = f"import sys; sys.{closed} = None; from met.cli import main; sys.exit(main(['check', 'two_link.ic']))"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, getattr(done, closed)) == (status, "") and done.stderr.startswith(said)


@pytest.mark.parametrize(("printed", "status", "said"), [("answer\n", 2, CLOSED), ("", 0, "")])
def test_what_a_closed_output_loses_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], printed: str, status: int, said: str
) -> None:
    offer(monkeypatch, do=command(lambda: cli.say(printed, end="") if printed else None))
    monkeypatch.setattr("sys.stdout", None)
    assert cli.main(["do"]) == status
    err = capsys.readouterr().err
    assert err.startswith(said) and bool(err) == bool(said)


@contextlib.contextmanager
def standard_files(monkeypatch: pytest.MonkeyPatch, **to: int) -> Iterator[None]:
    """A block in which the files under Python's own `stdout` or `stderr` are these instead."""
    numbers = {"stdout": 1, "stderr": 2}
    with monkeypatch.context() as patch:
        before = {name: os.dup(numbers[name]) for name in to}
        for name, file in to.items():
            patch.setattr(sys, name, getattr(sys, f"__{name}__"))
            os.dup2(file, numbers[name])
            os.close(file)
        try:
            yield
        finally:
            for name, file in before.items():
                os.dup2(file, numbers[name])
                os.close(file)


def full() -> int:
    return os.open("/dev/full", os.O_WRONLY)


def unread() -> int:
    """The writing end of a pipe whose reader has gone."""
    reader, writer = os.pipe()
    os.close(reader)
    return writer


def prints_and_keeps() -> None:
    with kept("a.h5 is whole"):
        print("one line", flush=True)


def prints_to_the_end() -> None:
    print("one line")


def refuses() -> None:
    raise Problem(error("D000", "nothing is right"))


FULL = "error[E338]: cannot write the standard output: no space left on device\n"
SEND = " = help: send it elsewhere, or free the disk that it goes to\n\n1 error\n"


@pytest.mark.parametrize(
    ("function", "output", "status", "said"),
    [
        (prints_to_the_end, full, 2, FULL + SEND),
        (prints_and_keeps, full, 2, f"{FULL} = help: a.h5 is whole\n{SEND}"),
        (prints_to_the_end, unread, 141, ""),
        (prints_and_keeps, unread, 141, "a.h5 is whole\n"),
        (refuses, full, 2, "error[D000]: nothing is right\n\n1 error\n"),
    ],
)
def test_output_that_cannot_be_written_is_named_and_a_reader_that_has_gone_is_no_error(
    function: object,
    output: Callable[[], int],
    status: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    offer(monkeypatch, do=command(function))
    with standard_files(monkeypatch, stdout=output()):
        assert cli.main(["do"]) == status
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("errors", [full, unread])
@pytest.mark.parametrize(("function", "status"), [(refuses, 2), (lambda: 1, 1), (lambda: print("x") or 0, 0)])
def test_errors_that_cannot_be_written_change_no_answer(
    function: object,
    status: int,
    errors: Callable[[], int],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def do() -> object:
        print("a warning", file=sys.stderr)
        return function()  # type: ignore[operator]

    offer(monkeypatch, do=command(do))
    with standard_files(monkeypatch, stderr=errors()):
        assert cli.main(["do"]) == status
    assert capsys.readouterr().out == "x\n" * (status == 0)


def test_a_pipe_that_does_not_wait_is_written_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """As programs leave a pipe that they share with us; 1 MB is more than it holds."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    offer(monkeypatch, do=command(lambda: print("x" * 1_000_000)))
    with open(reader, "rb") as file, ThreadPoolExecutor() as pool, standard_files(monkeypatch, stdout=writer):
        read = pool.submit(file.read)
        assert cli.main(["do"]) == 0
        os.close(os.dup2(full(), 1))  # the pipe's last writer
        assert len(read.result()) == 1_000_001


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["0 1 2", "1", "2"])
def test_no_file_of_a_command_gets_the_number_of_a_closed_stream(closed: str, tmp_path: Path) -> None:
    """Else what a library prints would get into an archive."""
    program = (
        f"import os, sys; [os.close(int(each)) for each in {closed.split()!r}];"
        f"{''.join(f'sys.std{name} = None;' for n, name in enumerate(('in', 'out', 'err')) if str(n) in closed)}"
        "from met.cli import main; status = main(['plan', 'two_link.ic', '-o', sys.argv[1]]);"
        f"sys.exit(status != {2 if '1' in closed else 0} or os.open(sys.argv[1], os.O_RDONLY) < 3)"
    )
    done = subprocess.run([sys.executable, "-c", program, tmp_path / "p.json"], cwd=ROOT, capture_output=True)
    assert done.returncode == 0


def test_a_defect_whose_traceback_cannot_be_kept_is_a_defect(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def divide() -> float:
        return 1 / 0

    monkeypatch.setattr("tempfile.tempdir", "/no/such/folder")
    offer(monkeypatch, divide=command(divide))
    assert cli.main(["divide"]) == cli.DEFECT
    assert "Its traceback cannot be written (no such file or directory): `-v` prints it. " in capsys.readouterr().err


def test_warnings_of_libraries_are_left_out_and_those_of_models_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(arguments: list[str]) -> int:
        warnings.warn("invalid value encountered in cast", RuntimeWarning, stacklevel=1)
        warnings.warn("this motor has no source", stacklevel=1)
        return 0

    monkeypatch.setattr(cli, "_run", run)
    monkeypatch.setattr(sys, "warnoptions", [])
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert cli.main([]) == 0
        assert capsys.readouterr().err == "met: warning: this motor has no source\n"
        with pytest.warns(RuntimeWarning, match="invalid value encountered in cast"), pytest.warns(UserWarning):
            cli.main(["-v"])


@pytest.mark.parametrize("package", [False, True])
@pytest.mark.parametrize("code", ["import ring9.inner", "from ring9 import inner", "import ring9; ring9.inner"])
def test_a_module_that_hides_one_that_is_needed_is_named(
    code: str, package: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """As `numpy.py` in a folder of PYTHONPATH; the remedy, done, works."""
    (tmp_path / "needed" / "ring9").mkdir(parents=True)
    needed = tmp_path / "needed" / "ring9" / "__init__.py"
    needed.write_text("from ring9 import inner")
    needed.with_name("inner.py").touch()
    hiding = tmp_path / "users" / ("ring9/__init__.py" if package else "ring9.py")
    hiding.parent.mkdir(parents=True)
    hiding.write_text("x = 1")
    for folder in ("needed", "users"):
        monkeypatch.syspath_prepend(tmp_path / folder)
    offer(monkeypatch, do=command(lambda: exec(code, {})))
    try:
        assert cli.main(["do"]) == 2
        assert capsys.readouterr().err == (
            f"error[E339]: `ring9` is {hiding} here, which hides {needed}\n"
            " = help: rename that file, or take its folder off PYTHONPATH\n\n1 error\n"
        )
        for name in [each for each in sys.modules if each.startswith("ring9")]:
            del sys.modules[name]
        sys.path.remove(str(tmp_path / "users"))
        assert cli.main(["do"]) == 0
    finally:
        for name in [each for each in sys.modules if each.startswith("ring9")]:
            del sys.modules[name]


def test_windows_is_refused_with_a_way_out(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    assert met_arm.main() == cli.BAD_INPUT
    assert capsys.readouterr().err == (
        "error[E338]: MET does not run on Windows itself\n"
        " = help: on Windows, install it in a Linux of WSL 2: `wsl --install`\n\n1 error\n"
    )


def test_where_mets_name_is_another_modules_already_that_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """As in a program of a user that has imported a `batch.py` of its own and calls the command."""
    (tmp_path / "batch.py").touch()
    other = ModuleType("batch")
    other.__file__ = str(tmp_path / "batch.py")
    monkeypatch.setitem(sys.modules, "batch", other)
    monkeypatch.syspath_prepend(tmp_path)
    assert cli.main(["check", "two_link.ic"]) == 2
    assert capsys.readouterr().err == (
        f"error[E339]: `batch` is {tmp_path / 'batch.py'} here, which hides {ROOT / 'batch' / '__init__.py'}\n"
        " = help: rename that file, or take its folder off PYTHONPATH\n\n1 error\n"
    )


SLOW_TO_IMPORT = {"llvmlite", "h5py", "h5netcdf", "xarray", "pandas", "dask", "matplotlib", "scipy", "pint"}


@pytest.mark.release
@pytest.mark.parametrize("words", ["check two_link.ic", "plan two_link.ic", "--version", "--help", "doc"])
def test_what_costs_a_tenth_of_a_second_is_not_imported(words: str) -> None:
    """Each of these packages takes 0.1 to 2 s to import, and none of these commands needs it."""
    program = (
        "import sys; from met.cli import main; status = main(sys.argv[1:]);"
        "print('IMPORTED', *sorted(name for name in sys.modules if '.' not in name)); sys.exit(status)"
    )
    done = subprocess.run([sys.executable, "-c", program, *words.split()], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    imported = set(done.stdout.rpartition("IMPORTED")[2].split())
    assert "click" in imported
    assert not imported & SLOW_TO_IMPORT


@pytest.mark.slow
def test_check_does_not_import_the_engine() -> None:
    program = "import sys; from met.cli import main; main(['check', 'two_link.ic', '-q']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    imported = set(done.stdout.split())
    assert "ic.driver.compile" in imported
    engine = {"met.backends.llvm.kernel", "met.backends.llvm.machine", "met.run", "batch"}
    assert not imported & engine  # its sweep is not compiled


@pytest.mark.parametrize("command", [
    ["check", "d.ic"], ["plan", "d.ic"], ["cases", "d.ic"], ["explain", "d.ic", "q"], ["dump", "plan", "d.ic"],
    ["run", "d.ic"], ["profile", "d.ic"], ["margin", "d.ic"],
])  # fmt: skip
def test_a_folder_of_i_that_is_not_there_is_an_error(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*command, "-I", "no/such"]) == 2
    assert "Error: Invalid value for '-I': Directory 'no/such' does not exist.\n" in capsys.readouterr().err
