"""Paths of a command's output, checked before any work is done; and settings given on a command line.

met.host.files.whole_file then writes the file, whole or not at all.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from met.diagnostic import Problem, error
from met.host.files import settle_folder

ELSEWHERE = "`-o FILE` names another place"
"""The remedy where a file cannot be written."""


def path_of(output: str | os.PathLike[str]) -> Path:
    """The path of a file to write. Raises Problem E305 for a name that ends in `/` where there is no such folder:
    a path keeps no slash, and the file would take the folder's name."""
    name = os.fspath(output)
    if name.endswith("/") and not os.path.isdir(name):
        file = name.rstrip("/")
        helps = (f"for a file: `-o {quoted(file)}`", f"for a folder, make it first: `mkdir -p {quoted(file)}`")
        raise Problem(error("E305", f"cannot write {name}: there is no such folder", help=helps))
    return Path(output)


def check_ending(output: Path, endings: Sequence[str], *, code: str, kinds: str, more: Sequence[str] = ()) -> None:
    """Refuse a file's name with an ending of other files. A folder is not looked at: `check_place` refuses it.

    endings  that suit;  the first is proposed instead
    code     of the error;  kinds: the end of its message, as "pictures are PNG, SVG or PDF files"
    more     further remedies

    Raises Problem; OSError where the system does not let it look.
    """
    if output.suffix.lower() not in endings and not output.is_dir():
        helps = [f"`-o {quoted(output.with_suffix(endings[0]))}`"] if output.name else []
        raise Problem(error(code, f"cannot write {output}: {kinds}", help=[*helps, *more]))


def check_place(output: Path, *, code: str, inside: Path | None = None) -> None:
    """Refuse a path at which no file can be written: a folder, a pipe, a path in a folder that is not there.

    code    of the error
    inside  a file to propose where `output` is a folder; None: none

    Raises Problem; OSError where the system does not let it look.
    """
    if output.is_dir():
        helps = () if inside is None else (f"name a file in it: `-o {quoted(inside)}`",)
        raise Problem(error(code, f"cannot write {output}: it is a folder", help=helps))
    if not output.parent.is_dir():
        what = "is a file, not a folder" if output.parent.exists() else "does not exist"
        helps = () if output.parent.exists() else (f"make it first: `mkdir -p {quoted(output.parent)}`",)
        raise Problem(error(code, f"cannot write {output}: {output.parent} {what}", help=helps))
    check_regular(output, code=code)


def check_regular(output: Path, *, code: str) -> None:
    """Refuse to replace a pipe, a device or a folder. Raises Problem, OSError."""
    if output.exists() and not output.is_file():
        raise Problem(error(code, f"cannot write {output}: it is not a regular file"))


def check_overwrite(
    output: Path,
    is_own: Callable[[Path], bool],
    *,
    code: str,
    because: str,
    remedy: str = "remove the file",
) -> None:
    """Refuse to overwrite a file with contents, unless it is one that MET may replace without asking.

    is_own   True for such a file
    because  the rest of "`output` exists ...", as "and is no report of MET"
    remedy   what to do besides giving another name

    Raises Problem, OSError.
    """
    if output.exists() and output.stat().st_size > 0 and not is_own(output):
        raise Problem(not_overwritten(output, code=code, because=because, remedy=remedy))


def not_overwritten(output: Path, *, code: str, because: str, remedy: str = "remove the file") -> Any:
    """The error that `output` exists and is left unchanged, with arguments as in `check_overwrite`."""
    helps = f"give another name with `-o`, or {remedy}"
    return error(code, f"{output} exists{because}: it is not written over", help=helps)


@contextmanager
def writing(output: Path, *, code: str, help: str | Sequence[str] = ()) -> Iterator[None]:
    """A block in which a file is looked at or written. Where the system refuses, it raises Problem, in the system's
    words."""
    try:
        yield
    except OSError as reason:
        raise Problem(error(code, f"cannot write {output}: {refusal_text(reason)}", help=help)) from reason


def settle_named(output: Path) -> None:
    """Wait until a whole file that has got its name is on the disk under it. Raises Problem where the disk has
    failed."""
    try:
        settle_folder(output.parent)
    except OSError as reason:
        message = f"{output} is whole, but its disk may lose it: {refusal_text(reason)}"
        raise Problem(error("E305", message, help="copy it to another disk")) from reason


def refusal_text(reason: OSError) -> str:
    """The system's reason for a refusal, as the end of a message: `no space left on device`."""
    return (os.strerror(reason.errno) if reason.errno else str(reason)).lower()


def quoted(path: Any) -> str:
    """A path as a word of a shell's command line, which is not taken for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


VARY = "vary"
"""First word of a setting that varies a path."""

_SUFFIX = "_varied"


def varies(setting: str) -> bool:
    """Return True for `vary PATH=VALUES`."""
    return setting.startswith(f"{VARY} ")


def to_set(text: str) -> str:
    """The setting that `--set` makes of a text; it never varies a path, whatever the text begins with."""
    return f" {text}" if varies(text) else text


def settings_of(settings: Iterable[str]) -> dict[str, Any]:
    """The settings as the arguments `set` and `vary` of `ic.compile`."""
    texts = tuple(settings)
    return {
        "set": tuple(text for text in texts if not varies(text)),
        "vary": tuple(text.removeprefix(f"{VARY} ") for text in texts if varies(text)),
    }


def setting_path(setting: str) -> str:
    """The path that is set or varied: `drive.kp`, `macro PARTS`."""
    return " ".join(setting.partition("=")[0].removeprefix(f"{VARY} ").split())


def setting_option(setting: str) -> str:
    """The option of a command line that makes this setting: `--set 'drive.kp=2 V/rad'`."""
    if varies(setting):
        return f"--vary {quoted(setting.removeprefix(f'{VARY} '))}"
    return f"--set {quoted(setting)}"


def varied_name(run: str, taken: Iterable[str]) -> str:
    """The name of the sweep of a run that a command line varies, which no run or sweep of the deck has."""
    known = set(taken)
    name, number = f"{run}{_SUFFIX}", 1
    while name in known:
        number += 1
        name = f"{run}{_SUFFIX}_{number}"
    return name


def varied_run(sweep: str) -> str:
    """The run that was varied, from the `varied_name` of the sweep."""
    return re.sub(rf"{_SUFFIX}(_\d+)?$", "", sweep)
