"""The command `met`: a group over the table of subcommands that packages offer, with their common options.

A subcommand is a click command offered as an entry point in the group `met.commands`; only the one that is asked for
is imported. It returns None or 0 for yes and 1 for no (a case failed, a requirement was missed); whatever a user got
wrong it raises as a `Problem`, which is printed here, once, and ends with 2.
"""

from __future__ import annotations

import gc
import io
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from types import MappingProxyType
from typing import Any, TypeVar

import click

from met.diagnostic import Diagnostic, Problem, error, nearest
from met.host.entry_points import EntryPoint, offered
from met.host.sources import names_archive, names_plan
from met.host.streams import OutputLost, standard_streams
from met.messages.visible import say
from met.outputs import VARY, refusal_text, setting_option, to_set, varies
from met.version import VERSION
from met_arm import REMEDY, find_own_packages, hiding

YES, NO, BAD_INPUT = 0, 1, 2
INTERRUPTED, PIPE_CLOSED = 130, 141  # 128 + the signal, as a shell counts
DEFECT = 70  # EX_SOFTWARE of sysexits.h

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType({
    "Write a deck": ("new", "import", "fmt", "check", "explain", "plan", "cases"),
    "Run it": ("run", "submit", "status"),
    "Look at what came out": ("show", "plot", "report", "view"),
    "Decide": ("best", "diff", "residuals", "fit", "sensitivity", "linear"),
    "Pass it on": ("export", "compile"),
    "Motors on a bed": ("margin", "bed"),
    "Help, and MET itself": ("doc", "lsp", "profile", "dump"),
})  # fmt: skip
"""The commands in `met --help` by what they are for, in the order of work."""

OTHERS = "Others"
"""The heading of commands that `GROUPS` does not name, as other packages offer them."""

ORDER = tuple(name for names in GROUPS.values() for name in names)

Face = TypeVar("Face", bound=Callable[..., Any])


class CommandTable(click.Group):
    """The commands of the table, each imported when it is asked for."""

    def table(self) -> dict[str, EntryPoint]:
        """Commands by name, in the order of work."""
        points = {point.name: point for point in reversed(offered("met.commands"))}
        known = [name for name in ORDER if name in points]
        return {name: points[name] for name in [*known, *sorted(points.keys() - set(known))]}

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.table())

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command of a name, imported now; None where there is none. Raises Problem E336 where its package cannot
        load it."""
        point = self.table().get(name)
        if point is None:
            return None
        try:
            command = point.load()
        except (ImportError, AttributeError) as reason:
            if point.package == "met_arm":
                raise
            message = f"cannot load the command `{name}` of the package `{point.package}`: {reason}"
            raise Problem(error("E336", message, help="mend or uninstall that package")) from reason
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of the first argument. Raises UsageError for an unknown one, with what may be meant."""
        name = args[0]
        if name not in self.table() and not name.startswith("-"):
            raise click.UsageError(f"no command `{name}`{self._meant(name)}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands in groups; of one that cannot be loaded, the reason."""
        lines = dict[str, str]()
        for name in self.table():
            try:
                command = self.get_command(ctx, name)
            except Problem as problem:
                lines[name] = problem.diagnostics[0].message
                continue
            if command is not None and not command.hidden:
                lines[name] = command.get_short_help_str(100)
        width = max(map(len, lines), default=0)
        for heading, names in {**GROUPS, OTHERS: tuple(name for name in lines if name not in ORDER)}.items():
            if rows := [(name.ljust(width), lines[name]) for name in names if name in lines]:
                with formatter.section(heading):
                    formatter.write_dl(rows)

    def _meant(self, name: str) -> str:
        """The end of the message about an unknown command: what may be meant."""
        if name.endswith(".ic"):
            return f"; did you mean `met run {name}`?"
        close = nearest(name, self.table())
        return f"; did you mean `met {close}`?" if close is not None else ""


_LONG = "met.long"  # key under which the context keeps the value of --long


def _keep_long(context: click.Context, _: click.Parameter, value: bool) -> None:
    context.meta[_LONG] = value


def _show_version(context: click.Context, _: click.Parameter, value: bool) -> None:
    """Show the version, in one line or with --long in several, and exit."""
    if value and context.meta[_LONG]:
        from met.about import about

        say(about())
        context.exit()
    if value:
        say(f"met {VERSION}")
        context.exit()
    if context.meta[_LONG]:
        raise click.UsageError("--long is for --version: `met --version --long`", context)


@click.command(
    cls=CommandTable,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
    epilog="Start with `met run two_link.ic`. `met COMMAND --help` says more.",
)
@click.option("--version", is_flag=True, expose_value=False, callback=_show_version, help="Show the version and exit.")
@click.option(
    "--long",
    is_flag=True,
    expose_value=False,
    is_eager=True,  # before --version, which reads it
    callback=_keep_long,
    help="With --version: also what a report of a defect needs.",
)
def met() -> None:
    """MET takes a robot arm from a text deck to an answer: what it does under its servos, in one case or a million.

    A deck is looked for as a file, then in the standard library. Exit status: 0 yes; 1 no (a case failed, a requirement
    was missed); 2 the input or the usage is wrong.
    """


def deck_options(face: Face) -> Face:
    """The options of commands that read a deck: -D, -I, --set and --vary, passed as `defines`, `include_dirs` and
    `settings` (for --vary, `vary PATH=VALUES`)."""
    face = click.option(
        "--vary",
        multiple=True,
        metavar="PATH=VALUES",
        expose_value=False,
        is_eager=True,  # before --set, which includes it
        callback=_keep_varied,
        help="Sweep the run over these values, as `vary` does: 'gearbox.kp=0.01..0.1 by 0.01 V*s/rad'; several are "
        "combined.",
    )(face)
    face = click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="PATH=VALUE",
        callback=_with_varied,
        help="Replace the value of a path that `vary` can name: 'gearbox.kp=0.02 V*s/rad'; may be repeated.",
    )(face)
    face = click.option(
        "-I",
        "include_dirs",
        multiple=True,
        metavar="DIR",
        type=click.Path(exists=True, file_okay=False),
        help="Also look for included files here; may be repeated.",
    )(face)
    return click.option(
        "-D", "defines", multiple=True, metavar="NAME[=VALUE]", help="Define a macro, as #define does; may be repeated."
    )(face)


_VARIED = "met.varied"  # key under which the context of a command keeps the values of --vary


def _keep_varied(context: click.Context, _: click.Parameter, values: tuple[str, ...]) -> None:
    context.meta[_VARIED] = tuple(f"{VARY} {value.strip()}" for value in values)


def _with_varied(context: click.Context, _: click.Parameter, values: tuple[str, ...]) -> tuple[str, ...]:
    return (*map(to_set, values), *context.meta.get(_VARIED, ()))


def check_options(
    source: str,
    names: Sequence[str] = (),
    everything: bool = False,
    defines: Sequence[str] = (),
    include_dirs: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> None:
    """Refuse options that clash or would have no effect, as click refuses a value that it cannot read."""
    if names and everything:
        raise click.UsageError(f"--all and `{names[0]}` exclude each other: name runs and sweeps, or take all")
    for option, options in (("-D", defines), ("-I", include_dirs)):
        if options and names_plan(source):
            raise click.UsageError(f"{option} is for decks: `{source}` is a plan, whose macros are expanded already")
    varied = [setting for setting in settings if varies(setting)]
    set_or_vary = "--vary" if settings and len(varied) == len(settings) else "--set"
    if varied and everything:
        raise click.UsageError("--vary is of one run, and --all of all: name the run")
    if settings and names_plan(source):
        instead = f"`met plan DECK {setting_option(settings[0])} -o {source}` makes another"
        settled = "cases are listed" if set_or_vary == "--vary" else "values are settled"
        raise click.UsageError(f"{set_or_vary} is for decks: `{source}` is a plan, whose {settled}; {instead}")
    if names_archive(source):
        for option, wanted in (("-D", defines), ("-I", include_dirs), (set_or_vary, settings)):
            if wanted:
                raise click.UsageError(f"{option} is for decks: `{source}` is an archive, of what was run")


PROGRAM_FORMS = ("json", "sarif", "github")
"""Forms of diagnostics that programs read; `met check` writes them all, other commands JSON alone."""


class FiniteRange(click.FloatRange):
    """A number of a closed range, which excludes `nan`, although no comparison refuses it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the number, as `click.FloatRange` does. Raises a usage error for one that is not in the range."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return float(number)


def format_option(face: Face) -> Face:
    """The option --format: text for people or JSON for programs, diagnostics included; passed as `form`."""
    return click.option(
        "--format",
        "form",
        type=click.Choice(["text", "json"]),
        default="text",
        help="Form of the output: text for people, json for programs.",
    )(face)


def loudness_options(face: Face) -> Face:
    """The options -q and -v, passed as `quiet` and `verbose`."""
    face = click.option("-v", "--verbose", is_flag=True, help="Print more, and tracebacks.")(face)
    return click.option("-q", "--quiet", is_flag=True, help="Print only errors.")(face)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `met` with these arguments (those of the process by default) and return its exit status."""
    argv = list(sys.argv[1:] if arguments is None else arguments)
    # numpy's linear algebra would start a thread a core while it is imported (a sixth of `met check`); MET has its own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # HDF5 loads a library because a file names its filter, from wherever the environment says; archives have none.
    os.environ.setdefault("HDF5_PLUGIN_PRELOAD", "::")
    # A start makes many objects and drops few: by default the garbage collector runs some 30 times, 15 ms of a start.
    gc.set_threshold(50_000)
    with standard_streams() as output:
        status, words = BAD_INPUT, ""
        try:
            with _without_library_warnings(argv):
                status = _run(argv)
            sys.stdout.flush()
        except OutputLost as lost:
            words = str(lost)
        if output is None or output.refusal is None:
            return status
        if isinstance(output.refusal, BrokenPipeError):  # the reader of our output has gone (`met cases | head`)
            if words:
                say(words, err=True)
            return PIPE_CLOSED
        message = f"cannot write the standard output: {refusal_text(output.refusal)}"
        helps = "send it elsewhere, or free the disk that it goes to"
        complain([error("E338", message, help=[words, helps] if words else helps)], {})
        return BAD_INPUT


@contextmanager
def _without_library_warnings(arguments: Sequence[str]) -> Iterator[None]:
    """Leave out the warnings of libraries about numbers and about what is old: they are of MET's code, which a user
    cannot change. `-v` and PYTHONWARNINGS show them; a warning of MET or of a model (UserWarning) is said without the
    line of code that gave it."""

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if category is UserWarning:
            say(f"met: warning: {message}", err=True)

    show_warning = warnings.showwarning
    if not (sys.warnoptions or "-v" in arguments or "--verbose" in arguments):
        warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = show_warning


def _form_asked(arguments: Sequence[str]) -> str:
    """The form in which a usage error is printed too: that of --format."""
    known = PROGRAM_FORMS if arguments[:1] == ["check"] else ("json",)
    forms = [form for option, form in pairwise(arguments) if option == "--format"]
    forms += [argument.removeprefix("--format=") for argument in arguments if argument.startswith("--format=")]
    return forms[-1] if forms and forms[-1] in known else "text"


def _run(arguments: list[str]) -> int:
    """Run the command of these arguments; returns its exit status. What it raises is printed as a message, but for
    OutputLost."""
    form = _form_asked(arguments)
    verbose = "-v" in arguments or "--verbose" in arguments
    try:
        if "_MET_COMPLETE" in os.environ:
            met.main(arguments, prog_name="met")  # a shell asks for completions; click answers and ends
        # Not `met.main`, which would print errors and choose many exit statuses itself.
        find_own_packages()
        with met.make_context("met", arguments) as context:
            status = met.invoke(context)
        return status if isinstance(status, int) else YES
    except click.exceptions.Exit as leaving:  # --help, --version, or a command that leaves early
        return leaving.exit_code
    except Problem as problem:
        complain(problem.diagnostics, problem.sources, form=form)
        return BAD_INPUT
    except click.ClickException as mistake:
        if form != "text":
            complain([error("U001", mistake.format_message())], {}, form=form)
        else:
            text = io.StringIO()
            mistake.show(text)
            say(text.getvalue(), end="", err=True)
        return BAD_INPUT
    except OutputLost:
        raise
    except (KeyboardInterrupt, click.Abort):
        print("\nmet: interrupted", file=sys.stderr)
        return INTERRUPTED
    except (MemoryError, OSError) as lacking:
        if verbose:
            _show_traceback()
        complain([of_machine(lacking)], {}, form=form)
        return BAD_INPUT
    except Exception as defect:
        if words := hiding(defect):
            complain([error("E339", words, help=REMEDY)], {}, form=form)
            return BAD_INPUT
        confess(defect, arguments, verbose=verbose)
        return DEFECT


def of_machine(lacking: MemoryError | OSError) -> Diagnostic:
    """The error of a machine that lacks something: memory, E337, or a file or device, E338."""
    if isinstance(lacking, MemoryError):
        message = "there is not enough memory for this"
        return error("E337", message, help="run fewer cases at once, or record less")
    about = f"`{os.fsdecode(lacking.filename)}`: " if isinstance(lacking.filename, str | bytes) else ""
    return error("E338", f"{about}{lacking.strerror or lacking}")


def complain(
    diagnostics: Sequence[Diagnostic],
    sources: Mapping[str, str],
    *,
    form: str = "text",
    allowed: Sequence[tuple[Diagnostic, str]] | None = None,
    titles: Mapping[str, str] | None = None,
) -> None:
    """Print diagnostics: for people on stderr, for programs on stdout, with the warnings that a deck allows and why.

    form    text, or one of `PROGRAM_FORMS`
    titles  what codes are about, for SARIF
    """
    from met.messages import programs, render

    if form == "json":
        print(programs.to_json(diagnostics, sources, allowed))
        return
    if form == "sarif":
        print(programs.to_sarif(diagnostics, sources, allowed or (), titles or {}))
        return
    if form == "github":
        print(programs.to_github(diagnostics), end="")
        return
    print(render.render(diagnostics, sources, colour=render.wants_colour(sys.stderr)), end="", file=sys.stderr)


def confess(defect: Exception, arguments: Sequence[str], *, verbose: bool) -> str:
    """Report a defect of MET, in a paragraph, which is returned; the traceback goes into a file, or with -v to the
    terminal. To be called while the exception is handled."""
    import shlex
    import tempfile
    import traceback

    from met.about import about

    command = shlex.join(["met", *arguments])
    if verbose:
        _show_traceback()
        where = "The traceback is above."
    else:
        try:
            handle, path = tempfile.mkstemp(prefix="met-defect-", suffix=".txt")
            with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(f"{command}\n{about()}\n\n")
                traceback.print_exception(defect, file=file)
            where = f"The traceback is in {path}."
        except OSError as reason:
            where = f"Its traceback cannot be written ({refusal_text(reason)}): `-v` prints it."
    words = (
        f"met: this is a defect of MET, not of what you gave it: {type(defect).__name__}: {defect}. {where} "
        f"Please report it together with the deck and the command, `{command}`."
    )
    say(words, err=True)
    return words


def _show_traceback() -> None:
    import traceback

    say(traceback.format_exc(), end="", err=True)


if __name__ == "__main__":
    sys.exit(main())
