"""Makes or mends MET's environment, .venv in the checkout; started by scripts/environment, which finds the Python.

    environment.py ROOT PYTHON run|test|all

The environment holds exactly what a lock file names and MET itself, installed so that the checkout's files are what
runs. Each lock holds all of the one before: requirements.lock for `run`, requirements-test.lock for `test`,
requirements-all.lock for `all`. The environment is whole or it is not there:

    .venv/met/                    made first: this environment is ours, and may be taken away again
    .venv/met/made                the checkout's path and the Python it was made with
    .venv/met/requirements.lock   a copy of the lock, put there last; scripts/met compares it with the checkout's

So a start that was killed half-way, a checkout that was moved and a lock that changed all end the same way: it is made
anew. Of several starts at once, one makes it and the others wait. Only the standard library is used here.
"""

from __future__ import annotations

import fcntl
import filecmp
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

VERSION = ".".join(map(str, sys.version_info[:3]))
# The Python itself, where what started us is that of an environment: perhaps of ours, active in the caller's shell.
PYTHON: str = getattr(sys, "_base_executable", sys.executable)
# What each purpose installs, the smallest first: an environment made for one serves all before it.
LOCKS = {"run": "requirements.lock", "test": "requirements-test.lock", "all": "requirements-all.lock"}
ADDED = {"test": "what the tests need", "all": "what `scripts/test --ci` and `scripts/docs` need"}
NO_CONNECTION = re.compile(
    r"NewConnectionError|NameResolutionError|ConnectTimeout|ProxyError|Network is unreachable|Connection refused"
    r"|name resolution|Name or service not known|Max retries exceeded"
)
# What a user's pip settings may not do here: put the packages anywhere but into the environment.
ELSEWHERE = ("PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER", "PYTHONPATH", "PYTHONHOME")


class Refusal(Exception):
    """The environment cannot be made; the text is the one line that says why and what to do."""


def say(text: str) -> None:
    print(f"met: {text}", file=sys.stderr, flush=True)


def main(root: Path, python: str, purpose: str) -> int:
    try:
        import ensurepip
        import venv  # noqa: F401  (both are looked for only: `python -m venv` needs them)
    except ImportError as reason:
        package = f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"
        raise Refusal(
            f"Python {VERSION} ({python}) comes without `{reason.name}`, which makes environments; install it "
            f"(Debian, Ubuntu: apt install {package}) or name another Python in MET_PYTHON"
        ) from None
    del ensurepip
    with open(__file__) as turn:  # a lock that the kernel takes back from whoever dies
        try:
            fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another start is making the environment; waiting for it")
            fcntl.flock(turn, fcntl.LOCK_EX)
        make(root, PYTHON if sys.prefix != sys.base_prefix else python, purpose)
    return 0


def make(root: Path, python: str, purpose: str) -> None:
    """Bring .venv to what `purpose` needs, doing as little as that takes."""
    venv = root / ".venv"
    marks = venv / "met"
    if (venv.exists() or venv.is_symlink()) and not marks.is_dir():
        raise Refusal(
            f"{venv} is not an environment that scripts/met made, so it is left alone; move it away, or use it "
            f"yourself: `pip install -e .` in it, then `met`"
        )
    reason = why_anew(root, venv, python)
    if reason is None and holds(root, marks, purpose):
        return
    if reason is None and not (marks / LOCKS[purpose]).exists():
        say(f"adding {ADDED[purpose]} to the environment")
        install(root, venv, purpose)
        for smaller in up_to(purpose):
            mark(root, marks, smaller)
        return
    if venv.exists():
        say(f"making the environment in .venv anew: {reason or f'{LOCKS[purpose]} has changed'}")
        purpose = max(purpose, made_for(marks), key=list(LOCKS).index)
    else:
        say(f"making the environment in .venv with Python {VERSION} (once, a minute or so)")
    clear(venv)
    marks.mkdir(parents=True)
    (marks / "made").write_text(f"{root}\n{python}\n")
    step([PYTHON, "-I", "-m", "venv", str(venv)], marks / "log", "cannot make an environment")
    install(root, venv, purpose)
    step(
        pip(venv, "--no-index", "--no-deps", "--no-build-isolation", "--editable", str(root)),
        marks / "log",
        "cannot install MET itself",
    )
    for smaller in reversed(up_to(purpose)):
        mark(root, marks, smaller)
    say("the environment is ready")


def up_to(purpose: str) -> list[str]:
    """The purposes that an environment made for `purpose` serves, the smallest first."""
    purposes = list(LOCKS)
    return purposes[: purposes.index(purpose) + 1]


def made_for(marks: Path) -> str:
    """The largest purpose that the environment was once made for, whatever has become of its lock since."""
    return next((purpose for purpose in reversed(LOCKS) if (marks / LOCKS[purpose]).exists()), "run")


def why_anew(root: Path, venv: Path, python: str) -> str | None:
    """Why the environment must be made from nothing; None where what is there is whole and right."""
    marks = venv / "met"
    if not marks.exists():
        return "there is none"
    if not (marks / LOCKS["run"]).exists() or not (venv / "bin" / "met").exists():
        return "it was left half made"
    made_in, made_with = (marks / "made").read_text().splitlines()
    if made_in != str(root):
        return f"the checkout was moved here from {made_in}"
    if not holds(root, marks, "run"):
        return "requirements.lock has changed"
    if os.environ.get("MET_PYTHON") and made_with != python:
        return f"MET_PYTHON is now {python}, it was {made_with}"
    return why_not_started(venv / "bin" / "python", made_with)


def why_not_started(python: Path, made_with: str) -> str | None:
    """Why the environment's Python does not start; None where it does.

    Raises Refusal where it is there and this user may not run it: the environment is another user's, and whole.
    """
    try:
        python.stat()
        if os.access(python, os.X_OK):
            return None
    except PermissionError:
        pass
    except OSError:
        return f"its Python, {made_with}, is gone"
    raise Refusal(
        f"the environment in {python.parents[1]} was made with {made_with}, which you may not run: another user's "
        f"Python. Use a checkout of your own, or have this one's owner name a Python that all may run, once: "
        f"MET_PYTHON=/usr/bin/python3 scripts/met --version"
    )


def holds(root: Path, marks: Path, purpose: str) -> bool:
    """True where the environment was made from this very lock."""
    wanted, installed = root / LOCKS[purpose], marks / LOCKS[purpose]
    return installed.exists() and filecmp.cmp(wanted, installed, shallow=False)


def mark(root: Path, marks: Path, purpose: str) -> None:
    """Say that all which this lock names is there: by one rename, so that it is said wholly or not at all."""
    half = marks / "half"
    shutil.copyfile(root / LOCKS[purpose], half)
    half.replace(marks / LOCKS[purpose])


def clear(venv: Path) -> None:
    """Take an environment away; one that was already on its way out as well."""
    leaving = venv.with_name(".venv.leaving")
    shutil.rmtree(leaving, ignore_errors=True)
    if venv.exists():
        venv.rename(leaving)
        shutil.rmtree(leaving, ignore_errors=True)


def install(root: Path, venv: Path, purpose: str) -> None:
    lock = root / LOCKS[purpose]
    count = len(re.findall(r"^[\w-]+==", lock.read_text(), re.MULTILINE))
    say(f"installing the {count} packages that {lock.name} names")
    # Wheels only: a machine for which there is none gets a line that says so, not an hour of a compiler's output.
    arguments = ("--require-hashes", "--no-deps", "--only-binary", ":all:", "--requirement", str(lock))
    step(pip(venv, *arguments), venv / "met" / "log", f"cannot install what {lock.name} names")


def pip(venv: Path, *arguments: str) -> list[str]:
    quiet = ("--disable-pip-version-check", "--no-input", "--retries", "2")
    return [str(venv / "bin" / "python"), "-I", "-m", "pip", "install", *quiet, *arguments]


def step(command: list[str], log: Path, failure: str) -> None:
    """Run a command with its words kept in the log; raises Refusal with the last that it said."""
    surroundings = {name: value for name, value in os.environ.items() if name not in ELSEWHERE}
    with log.open("ab") as words:
        start = words.tell()
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=words, stderr=words, env=surroundings)
    if done.returncode == 0:
        return
    log_text = log.read_bytes()[start:].decode(errors="replace")
    if NO_CONNECTION.search(log_text):
        raise Refusal(
            f"{failure}: no connection to the package index; connect for this once, or name a mirror (PIP_INDEX_URL) "
            f"or a folder of wheels (PIP_FIND_LINKS with PIP_NO_INDEX=1); pip's own words are in {log}"
        )
    lines = [line for line in log_text.splitlines() if line.strip()]
    last = next((line for line in reversed(lines) if "rror" in line), lines[-1] if lines else "it said nothing")
    raise Refusal(f"{failure}: {last.strip()}; all of its words are in {log}")


if __name__ == "__main__":
    try:
        sys.exit(main(Path(sys.argv[1]), sys.argv[2], sys.argv[3]))
    except Refusal as refusal:
        say(f"error: {refusal}")
    except OSError as refusal:
        say(
            f"error: cannot make the environment in {sys.argv[1]}/.venv: {refusal.strerror or refusal}; it needs a "
            f"checkout that you may write to, with 1 GB free"
        )
    except KeyboardInterrupt:
        say("stopped; the next start makes the environment from the beginning")
        sys.exit(130)
    sys.exit(2)
