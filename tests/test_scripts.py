"""scripts/met and its kin: they make the environment, start fast once it stands, and refuse in one clear line."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import pytest

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-test.lock", "requirements-all.lock")
TOOLS = ("sh", "bash", "readlink", "dirname", "cat", "uname", "env")
# For `met --version`, `met check` and scripts/test: the locks whole are what .ci/run installs before any test.
TO_START = {"click", "setuptools"}
TO_CHECK = TO_START | {"numpy", "pcpp"}
TO_TEST = TO_START | {
    *("execnet", "iniconfig", "packaging", "pluggy", "pygments", "pytest", "pytest-xdist", "ruff"),
    *("hypothesis", "sortedcontainers"),
    *("grimp", "import-linter", "lazy-importer", "markdown-it-py", "mdurl", "rich"),
    *("ast-serialize", "librt", "mypy", "mypy-extensions", "pathspec", "typing-extensions"),
}


@pytest.fixture
def checkout() -> Iterator[Path]:
    """A copy of the scripts and of what an installation needs, in a place that any user may read."""
    directory = Path(mkdtemp(prefix="met-checkout-"))
    directory.chmod(0o755)
    for name in ("scripts", "met", "ic", "batch", "hw"):
        shutil.copytree(ROOT / name, directory / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in (*LOCKS, "met_arm.py", "met_conformance.py", "setup.cfg", "pyproject.toml", "LICENSE", "README.md"):
        shutil.copy(ROOT / name, directory)
    yield directory
    shutil.rmtree(directory)


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    """A directory with the few programs that the scripts use, and no Python."""
    directory = tmp_path / "bin"
    directory.mkdir()
    for name in TOOLS:
        found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/bin:/bin")
        assert found is not None
        (directory / name).symlink_to(found)
    return directory


def program(path: Path, text: str) -> Path:
    path.write_text(text)
    path.chmod(0o755)
    return path


def start(checkout: Path, *words: str, script: str = "met", **surroundings: str) -> subprocess.CompletedProcess[str]:
    """One of the scripts, with HOME empty and none of the caller's settings but where packages come from."""
    kept = {name: value for name, value in os.environ.items() if name == "PATH" or name.startswith(("PIP_", "SSL_"))}
    home = checkout / "home"
    home.mkdir(exist_ok=True)
    return subprocess.run(
        [checkout / "scripts" / script, *words],
        capture_output=True,
        text=True,
        cwd="/",
        env={**kept, "HOME": str(home), "LC_ALL": "C.UTF-8", **surroundings},
    )


def shorten(checkout: Path, lock: str, names: set[str]) -> None:
    """Leave of a lock file what these packages need, so that pip has little to install: hashes and versions stay."""
    head, *packages = re.split(r"^(?=[\w-]+==)", (checkout / lock).read_text(), flags=re.MULTILINE)
    kept = [package for package in packages if package.partition("==")[0] in names]
    assert {package.partition("==")[0] for package in kept} == names
    (checkout / lock).write_text(head + "".join(kept))


def make_ready(checkout: Path) -> None:
    """An environment that looks whole, whose `met` only echoes."""
    for name in ("bin", "met"):
        (checkout / ".venv" / name).mkdir(parents=True)
    shutil.copy(checkout / "requirements.lock", checkout / ".venv" / "met")
    (checkout / ".venv" / "met" / "made").write_text(f"{checkout}\n/usr/bin/python3\n")
    (checkout / ".venv" / "bin" / "python").symlink_to(sys.executable)
    program(checkout / ".venv" / "bin" / "met", '#!/bin/sh\nprintf "[%s]" "$@"\n')
    program(checkout / "scripts" / "environment", "#!/bin/sh\necho environment asked for $1 >&2\nexit 7\n")


def test_with_an_environment_a_start_only_starts(checkout: Path) -> None:
    make_ready(checkout)
    done = start(checkout, "run", "a deck.ic", "--case", "#0", "")
    assert (done.returncode, done.stdout, done.stderr) == (0, "[run][a deck.ic][--case][#0][]", "")


def test_it_starts_through_a_symbolic_link(checkout: Path, tmp_path: Path) -> None:
    make_ready(checkout)
    link = tmp_path / "met"
    link.symlink_to(checkout / "scripts" / "met")
    for words, directory in (([link, "x"], tmp_path), (["./met", "x"], checkout / "scripts")):
        done = subprocess.run(words, capture_output=True, text=True, cwd=directory, env={"PATH": os.environ["PATH"]})
        assert done.stdout == "[x]", done.stderr


@pytest.mark.alone
def test_the_script_adds_little_to_a_start(checkout: Path) -> None:
    """Measured 4 ms; 50 ms leave room for a busy machine and are still not felt."""
    make_ready(checkout)
    took = []
    for _ in range(7):
        begun = time.perf_counter()
        start(checkout)
        took.append(time.perf_counter() - begun)
    assert min(took) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("what", ["lock", "place", "python", "half", "other"])
def test_what_no_longer_holds_makes_the_environment_be_asked_for(checkout: Path, what: str) -> None:
    make_ready(checkout)
    venv = checkout / ".venv"
    surroundings = {}
    match what:
        case "lock":
            (checkout / "requirements.lock").write_text("numpy==99\n")
        case "place":
            (venv / "met" / "made").write_text("/elsewhere\n/usr/bin/python3\n")
        case "python":
            (venv / "bin" / "python").unlink()
            (venv / "bin" / "python").symlink_to("/no/such/python")
        case "half":
            (venv / "met" / "requirements.lock").unlink()
        case "other":
            surroundings["MET_PYTHON"] = sys.executable
    done = start(checkout, "x", **surroundings)
    assert (done.returncode, done.stdout, done.stderr) == (7, "", "environment asked for run\n")


@pytest.mark.slow
def test_an_old_python_is_refused_in_one_line(checkout: Path, tools: Path) -> None:
    old = "#!/bin/sh\ncase $2 in *exit*) exit 1 ;; *) echo 3.9.2 ;; esac\n"
    program(tools / "python3", old)
    done = start(checkout, PATH=str(tools))
    assert (done.returncode, done.stdout, done.stderr) == (
        2,
        "",
        "met: error: MET needs Python 3.11 or newer (python3 is 3.9.2); install one, or name it: "
        "MET_PYTHON=/path/to/python3.12 scripts/met\n",
    )


@pytest.mark.slow
def test_no_python_at_all_is_refused_in_one_line(checkout: Path, tools: Path) -> None:
    done = start(checkout, PATH=str(tools))
    assert done.returncode == 2
    assert done.stderr.startswith("met: error: MET needs Python 3.11 or newer (no Python found); ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_newer_python_beside_an_old_one_is_found(checkout: Path, tools: Path) -> None:
    program(tools / "python3", "#!/bin/sh\nexit 1\n")
    program(tools / "python3.12", '#!/bin/sh\n[ "$1" = -I ] && echo "made with $4"\nexit 0\n')
    done = start(checkout, script="environment", PATH=str(tools))
    assert (done.returncode, done.stdout) == (0, f"made with {tools}/python3.12\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, "met: error: MET_PYTHON is `{python}`, and there is no such program\n"),
        ("exit 1", "met: error: MET_PYTHON is `{python}` (not a Python that starts); MET needs Python 3.11 or newer\n"),
        (
            'case $2 in *exit*) exit 1 ;; *) echo "Python 3.10.1" ;; esac',
            "met: error: MET_PYTHON is `{python}` (Python 3.10.1); MET needs Python 3.11 or newer\n",
        ),
    ],
)
def test_a_wrong_met_python_is_refused_in_one_line(
    checkout: Path, tmp_path: Path, text: str | None, expected: str
) -> None:
    python = tmp_path / "my python"
    if text is not None:
        program(python, f"#!/bin/sh\n{text}\n")
    done = start(checkout, MET_PYTHON=str(python))
    assert (done.returncode, done.stderr) == (2, expected.format(python=python))


@pytest.mark.slow
def test_a_python_without_venv_is_refused_in_one_line(checkout: Path, tmp_path: Path) -> None:
    """As on a Debian without python3-venv: `ensurepip` is missing."""
    without = (
        "import runpy, sys; sys.modules['ensurepip'] = None; sys.argv = sys.argv[1:]; "
        "runpy.run_path(sys.argv[0], run_name='__main__')"
    )
    real = sys.executable
    text = f'#!/bin/sh\n[ "$1" = -I ] && shift && exec {real} -I -c "{without}" "$@"\nexec {real} "$@"\n'
    python = program(tmp_path / "python3", text)
    done = start(checkout, MET_PYTHON=str(python))
    minor = sys.version_info[1]
    assert (done.returncode, done.stderr) == (
        2,
        f"met: error: Python 3.{minor}.{sys.version_info[2]} ({python}) comes without `ensurepip`, which makes "
        f"environments; install it (Debian, Ubuntu: apt install python3.{minor}-venv) or name another Python in "
        "MET_PYTHON\n",
    )


@pytest.mark.slow
def test_an_environment_that_someone_else_made_is_left_alone(checkout: Path) -> None:
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / "mine").write_text("precious")
    done = start(checkout)
    assert (done.returncode, done.stderr) == (
        2,
        f"met: error: {checkout}/.venv is not an environment that scripts/met made, so it is left alone; move it away, "
        "or use it yourself: `pip install -e .` in it, then `met`\n",
    )
    assert (checkout / ".venv" / "mine").read_text() == "precious"


@pytest.mark.slow
def test_a_read_only_checkout_is_refused_in_one_line(checkout: Path) -> None:
    (checkout / "home").mkdir()
    checkout.chmod(0o555)
    nobody = 65534
    done = subprocess.run(
        [checkout / "scripts" / "met"],
        capture_output=True,
        text=True,
        cwd="/",
        env={"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": "/", "MET_PYTHON": _any_users_python()},
        user=nobody if os.geteuid() == 0 else None,
    )
    checkout.chmod(0o755)
    assert (done.returncode, done.stderr.splitlines()[1:]) == (
        2,
        [
            f"met: error: cannot make the environment in {checkout}/.venv: Permission denied; it needs a checkout that "
            "you may write to, with 1 GB free"
        ],
    )


@pytest.mark.slow
def test_a_python_that_another_user_may_not_run_is_refused_in_one_line(checkout: Path, tmp_path: Path) -> None:
    """As for a second user of a checkout whose environment is made of a Python in its owner's closed home."""
    make_ready(checkout)
    shutil.copy(ROOT / "scripts" / "environment", checkout / "scripts")
    closed = tmp_path / "closed"
    closed.mkdir()
    program(closed / "python3", "#!/bin/sh\n")
    (checkout / ".venv" / "bin" / "python").unlink()
    (checkout / ".venv" / "bin" / "python").symlink_to(closed / "python3")
    (checkout / ".venv" / "met" / "made").write_text(f"{checkout}\n{closed}/python3\n")
    closed.chmod(0o000)
    done = subprocess.run(
        [checkout / "scripts" / "met"],
        capture_output=True,
        text=True,
        cwd="/",
        env={"PATH": f"{Path(_any_users_python()).parent}:/usr/bin:/bin", "HOME": "/"},
        user=65534 if os.geteuid() == 0 else None,
    )
    closed.chmod(0o755)
    assert (done.returncode, done.stderr) == (
        2,
        f"met: error: the environment in {checkout}/.venv was made with {closed}/python3, which you may not run: "
        "another user's Python. Use a checkout of your own, or have this one's owner name a Python that all may run, "
        "once: MET_PYTHON=/usr/bin/python3 scripts/met --version\n",
    )


def _any_users_python() -> str:
    """A Python that a user without rights may start: root's own may lie in a home directory that is closed."""
    wanted = "import sys, ensurepip; sys.exit(sys.version_info < (3, 11))"
    for name in (sys.executable, "/usr/bin/python3", "/usr/local/bin/python3"):
        user = 65534 if os.geteuid() == 0 else None
        try:
            if subprocess.run([name, "-c", wanted], capture_output=True, user=user, cwd="/").returncode == 0:
                return name
        except PermissionError:
            continue
    pytest.skip("no Python that a user without rights may start")


# Those that make environments


@pytest.mark.release
def test_the_first_start_makes_the_environment_and_the_next_only_starts(checkout: Path) -> None:
    shorten(checkout, "requirements.lock", TO_CHECK)
    first = start(checkout, "--version")
    assert (first.returncode, first.stdout[:4]) == (0, "met ")
    said = first.stderr.splitlines()
    assert len(said) == 3 and all(line.startswith("met: ") for line in said), said
    second = start(checkout, "check", "two_link.ic", "-q")
    assert (second.returncode, second.stdout, second.stderr) == (0, "", "")

    moved = checkout.with_name(f"{checkout.name}-moved")
    checkout.rename(moved)
    shorten(moved, "requirements.lock", TO_START)
    try:
        third = start(moved, "--version")
        assert (third.returncode, third.stdout) == (0, first.stdout)
        anew = f"met: making the environment in .venv anew: the checkout was moved here from {checkout}"
        assert third.stderr.splitlines()[0] == anew
        # A shell in which the environment is active offers its Python, which is about to be taken away.
        with (moved / "requirements.lock").open("a") as lock:
            lock.write("# changed\n")
        fourth = start(moved, "--version", PATH=f"{moved / '.venv/bin'}:{os.environ['PATH']}", MET_PYTHON="")
        assert (fourth.returncode, fourth.stdout) == (0, first.stdout), fourth.stderr
        assert "anew: requirements.lock has changed" in fourth.stderr.splitlines()[0]
    finally:
        moved.rename(checkout)


@pytest.mark.release
def test_of_two_starts_at_once_one_makes_the_environment_and_both_start(checkout: Path) -> None:
    shorten(checkout, "requirements.lock", TO_START)
    surroundings = {**os.environ, "HOME": str(checkout), "MET_PYTHON": ""}
    command = [checkout / "scripts" / "met", "--version"]
    both = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=surroundings)
        for _ in range(2)
    ]
    told = [process.communicate() for process in both]
    assert [process.returncode for process in both] == [0, 0], told
    assert told[0][0] == told[1][0] != ""
    assert sum("waiting for it" in err for _, err in told) == 1
    assert sum("installing the" in err for _, err in told) == 1


@pytest.mark.release
def test_a_start_that_was_killed_half_way_is_made_good_by_the_next(checkout: Path) -> None:
    shorten(checkout, "requirements.lock", TO_START)
    surroundings = {**os.environ, "HOME": str(checkout), "MET_PYTHON": ""}
    command = [checkout / "scripts" / "met", "--version"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=surroundings, start_new_session=True)
    assert process.stderr is not None
    while "installing" not in process.stderr.readline():
        assert process.poll() is None
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stderr.close()
    done = start(checkout, "--version")
    assert (done.returncode, done.stdout[:4]) == (0, "met ")
    assert done.stderr.splitlines()[0] == "met: making the environment in .venv anew: it was left half made"


@pytest.mark.release
def test_without_a_network_it_is_refused_in_one_line(checkout: Path) -> None:
    nowhere = {"PIP_INDEX_URL": "http://127.0.0.1:9/simple", "PIP_FIND_LINKS": "", "PIP_EXTRA_INDEX_URL": ""}
    done = start(checkout, **nowhere)
    assert (done.returncode, done.stderr.splitlines()[2:]) == (
        2,
        [
            "met: error: cannot install what requirements.lock names: no connection to the package index; connect for "
            "this once, or name a mirror (PIP_INDEX_URL) or a folder of wheels (PIP_FIND_LINKS with PIP_NO_INDEX=1); "
            f"pip's own words are in {checkout}/.venv/met/log"
        ],
    )


@pytest.mark.release
def test_scripts_test_adds_what_it_needs_and_ends_with_the_summary_of_pytest(checkout: Path) -> None:
    for lock, names in zip(LOCKS, (TO_START, TO_TEST, TO_TEST | {"mpmath"}), strict=True):
        shorten(checkout, lock, names)
    settings = (checkout / "setup.cfg").read_text()
    checked = "packages = met, ic, batch, hw, tests.hw.players\n"
    assert settings.count(checked) == 1
    (checkout / "setup.cfg").write_text(settings.replace(checked, "packages = met.version\n"))
    (checkout / "tests").mkdir()
    for name in ("conftest.py", "costs.py", "costs.toml"):
        shutil.copy(ROOT / "tests" / name, checkout / "tests")
    (checkout / "tests" / "instruction_sets.py").write_text('def header() -> str:\n    return "as in a checkout"\n')
    (checkout / "tests" / "test_it.py").write_text(
        "import pytest\n\n\ndef test_right() -> None:\n    assert 1 + 1 == 2\n\n\n"
        "@pytest.mark.slow\ndef test_skipped() -> None:\n    pytest.skip('no such tool')\n"
    )
    done = start(checkout, script="test")
    summary, types = done.stdout.splitlines()[-2:]
    assert "1 passed in" in summary, done.stdout + done.stderr  # and not the slow one
    assert types.startswith("scripts/test: mypy ")
    stages = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("scripts/test: ")]
    assert stages[:3] == ["ruff", "layout", "import-linter"]
    assert done.returncode == ("FAILED" in done.stdout)

    everything = start(checkout, "--all", script="test")
    assert everything.returncode == 1
    assert "1 failed, 1 passed" in everything.stdout.splitlines()[-2]
    assert "skipped, which is a failure with --ci and --all" in everything.stdout


@pytest.mark.slow
def test_scripts_benchmark_writes_its_figures(tmp_path: Path) -> None:
    words = ["version", "--repeats", "1", "-o", str(tmp_path / "figures.json")]
    done = subprocess.run([ROOT / "scripts" / "benchmark", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (figure,) = json.loads((tmp_path / "figures.json").read_text())["figures"]
    assert 0.0 < figure["median"] < 5.0  # a start of Python, however busy the machine


SMALL = '''"""A module."""

import ast
limit: int = 3
"""What is said of it."""


def small(numbers):
    """A function."""
    if (first := numbers[0]) > limit:
        return [-n if n < 0 else n for n in numbers for _ in range(2)]
    return lambda: ...
'''


def test_scripts_weigh_counts_statements_and_what_is_folded_into_expressions(tmp_path: Path) -> None:
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.c"]
    for name, text in {"ic/small.py": SMALL, "tests/text": "if not Python", "scripts/small.py": "a = 1\n"}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    shutil.copy(ROOT / "scripts" / "weigh", tmp_path / "scripts")
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "--message=small"]):
        subprocess.run([*git, *words], check=True)
    (tmp_path / "ic" / "small.py").unlink()
    (tmp_path / "hw").mkdir()
    (tmp_path / "hw" / "text.py").write_text("pass\npass\n")

    def weigh(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([tmp_path / "scripts" / "weigh", *words], capture_output=True, text=True)

    # import, limit, def, if, two returns; `:=`, a conditional expression, two `for`, a lambda
    done = weigh("--against", "HEAD")
    rows = re.findall(r"^(\w+) +(\d+).*, (\S+) since HEAD$", done.stdout, re.MULTILINE)
    weights = {name: (int(weight), int(change)) for name, weight, change in rows}
    weight_of_scripts, change_of_scripts = weights.pop("scripts")
    assert weight_of_scripts > 40 and change_of_scripts == 0  # the script itself, which has no suffix
    nothing = {"met": (0, 0), "batch": (0, 0), "tests": (0, 0)}
    assert weights == {"ic": (0, -11), "hw": (2, 2), "product": (2, -9), **nothing}
    assert weigh("--against", "HEAD~1").returncode == 2


def test_the_page_for_contributors_says_what_the_product_may_weigh() -> None:
    [limit] = re.findall(r"^MOST = (\S+)", (ROOT / "scripts" / "weigh").read_text(), re.MULTILINE)
    page = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split())
    assert f"at most {int(limit):,} statements" in page


STAND_IN = """\
#!/bin/sh
# A Python that makes environments with itself in them, runs what it reads, and says what else it would run.
here=$(dirname "$0")
case "$1 $2" in
    '-m venv') mkdir -p "$4/bin" && cp "$0" "$4/bin/python" && ln -sf /bin/true "$4/bin/met" ;;
    '- '*) exec REAL "$@" ;;
    *) echo "$@" >> "$here/../said"; [ "$2" != pytest ] || exit 3 ;;
esac
"""


def test_versions_tests_with_the_oldest_versions_and_with_the_newest(checkout: Path, tmp_path: Path) -> None:
    python = program(tmp_path / "python", STAND_IN.replace("REAL", sys.executable))
    done = start(checkout, "-k", "friction", script="versions", MET_PYTHON=str(python))
    assert done.returncode == 1, "the tests have failed"
    for age, numpy in (("oldest", "numpy == 2.0.2"), ("newest", "numpy >= 2.0.2")):
        folder = checkout / "build/versions" / age
        wanted = (folder / "requirements.txt").read_text().splitlines()
        assert numpy in wanted and "pcpp == 1.30" in wanted
        (locked,) = re.findall(r"^pytest==\S+", (checkout / "requirements-test.lock").read_text(), re.MULTILINE)
        assert locked in wanted, "what only the tests need is as locked"
        assert all(re.fullmatch(r"[\w.-]+ ?(==|>=) ?[\w.]+", line) for line in wanted)
        *_, editable, tests = (folder / "said").read_text().splitlines()
        assert "--editable ." in editable
        assert tests.startswith("-m pytest -n ") and tests.endswith(" -k friction")
    done = start(checkout, "newest", script="versions", MET_PYTHON=str(python))
    assert "newest" in done.stdout and "oldest" not in done.stdout
