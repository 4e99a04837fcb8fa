"""The declaration of a file format of `met export`: one file in this folder each, and one line in
`batch.formats.FORMATS`.

Its module has a `FORMAT`, an object of a class derived from `ExportFormat`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from batch.formats import FORMATS
from met.diagnostic import Problem, error
from met.frozen import frozen

if TYPE_CHECKING:
    from batch.archive.read import ArchiveFile
    from batch.campaigns.campaign import Campaign
    from batch.export.picking import ExportedCase
    from batch.export.tables import CaseTable, EvidenceColumns

Rows = Literal["metrics", "histories", "evidence"]
"""The rows of an export: a case with its metrics, an instant of a case, or a requirement at a design point."""

Option = Literal["units", "layout", "meshes"]
"""An option of `met export` that only some formats take."""


@frozen
class ExportRequest:
    """The options of an export besides its file.

    table     what its rows are to be; None: not said
    signals   signals that were named; none: all
    units     units of metrics and varied parameters: SI, or the deck's
    layout    True where a layout file was asked for
    force     True to overwrite any file that exists; None where the user has no way to say so
    named     True where cases were asked for one by one
    meshes    True to draw links by their meshes, where the format draws any; False where they are to be left out
    """

    table: Rows | None = None
    signals: tuple[str, ...] = ()
    units: Literal["si", "deck"] = "si"
    layout: bool = False
    force: bool | None = False
    named: bool = False
    meshes: bool = True


@frozen
class WrittenExport:
    """The number of rows of an export that was written, the layout file beside it, if any, and what is said of it."""

    rows: int
    layout: Path | None = None
    note: str = ""


class ExportFormat:
    """One file format.

    title       a file of it, as messages call it: "an MCAP file"
    tables      what its rows may be
    options     those of the options in `Option` that it takes
    metrics_in  for help, where a file without a table of metrics has them
    """

    title: str
    tables: tuple[Rows, ...] = ("metrics", "histories", "evidence")
    options: tuple[Option, ...] = ("units",)
    metrics_in: str = ""

    def is_own(self, path: Path) -> bool:
        """Return True where an existing file is an export of MET's in this format, which may be overwritten without
        asking."""
        return False

    def check_campaign(self, campaign: Campaign, target: Path) -> None:
        """Refuse, before anything runs, a campaign whose archive could not be exported. Raises Problem."""

    def write_table(self, file: ArchiveFile, table: CaseTable | EvidenceColumns, target: Path) -> WrittenExport:
        """Write a row for each case, with its varied values, metrics, requirements; or a row for each requirement.
        Raises Problem."""
        raise NotImplementedError

    def write_histories(
        self, file: ArchiveFile, cases: Sequence[ExportedCase], target: Path, request: ExportRequest
    ) -> WrittenExport:
        """Write the signals of these cases. Raises Problem."""
        raise NotImplementedError

    def check_request(self, request: ExportRequest, target: Path) -> None:
        """Refuse options that this format does not use. Raises Problem E375, E376."""
        evidence, metrics = request.table == "evidence", request.table == "metrics"
        signal = request.signals[0] if request.signals else ""
        refusals = (
            (
                request.layout and "layout" not in self.options,
                "E375",
                f"a layout shows an MCAP file, and {target} is none",
                "`-o FILE.mcap` writes one, and its layout",
            ),
            (
                not request.meshes and "meshes" not in self.options,
                "E375",
                f"an MCAP file draws the arm, and {target} is none",
                "leave `--no-meshes` out",
            ),
            (
                metrics and "metrics" not in self.tables,
                "E376",
                f"{target} would hold histories: {self.title} is no table of metrics",
                "; ".join(filter(None, ("`-o FILE.csv` writes one", self.metrics_in))),
            ),
            (
                evidence and "evidence" not in self.tables,
                "E376",
                f"{target} would hold no requirements: {self.title} is no table of evidence",
                "`-o FILE.csv` writes one",
            ),
            (
                "histories" not in self.tables and (request.table == "histories" or request.signals),
                "E376",
                f"{target} would be a table of metrics: {self.title} holds no histories",
                "`-o FILE.csv` and `-o FILE.mcap` hold them",
            ),
            (
                request.units != "si" and "units" not in self.options,
                "E376",
                f"{target} would be in SI: {self.title} has no other units",
                "`-o FILE.csv` can be in the deck's",
            ),
            (
                evidence and (request.signals or request.named),
                "E376",
                "evidence is of requirements over all cases: its table has no "
                + (f"signal `{signal}`" if request.signals else "case"),
                "leave out `--evidence`, or `--signals` and `--case`",
            ),
            (
                metrics and request.signals,
                "E376",
                f"signals are histories: a table of metrics has no `{signal}`",
                "leave out `--metrics`, or `--signals`",
            ),
        )
        for refused, code, message, helps in refusals:
            if refused:
                raise Problem(error(code, message, help=helps))


def find(name: str) -> ExportFormat:
    """The format of that name; its module is imported when it is first asked for. Raises KeyError."""
    export_format: ExportFormat = import_module(FORMATS[name]).FORMAT
    return export_format
