"""The table of evidence: what the cases show of each requirement over a share of cases."""

from __future__ import annotations

from batch.queries.evidence import EvidenceRow, evidence, percent_above, percent_below
from batch.queries.pool import Pool, page_number
from batch.report.contents.parts import TextTable

HEADS = (
    "requirement", "at", "verdict", "cases", "missed", "share of all", "bound", "worst", "margin", "in sigmas",
)  # fmt: skip
RIGHT = frozenset(range(3, 10))
VERDICT = HEADS.index("verdict")


def evidence_table(pool: Pool) -> TextTable | None:
    """A row for each requirement and design point; None where no requirement is over a share of cases.

    share of all  the bound on the share of all cases that may be drawn, with the confidence
    bound         of the percentile, with the confidence
    margin        from the worst value to the limit, and from the mean to the limit in standard deviations of the values
    """
    found = [(row, int(group.values("case")[row.worst])) for group in pool.groups for row in evidence(group)]
    texts = [row.requirement.text for row, _ in found]
    if not found:
        return None
    return TextTable(
        heads=HEADS,
        units=("",) * len(HEADS),
        rows=tuple(_cells(row, case, at == 0 or texts[at] != texts[at - 1]) for at, (row, case) in enumerate(found)),
        right=RIGHT,
        marked=frozenset((place, VERDICT) for place, (row, _) in enumerate(found) if not row.ok),
    )


def _cells(row: EvidenceRow, case: int, first: bool) -> tuple[str, ...]:
    """The texts of a row. case: the number of the worst case; first: True where its requirement is named."""

    def quantity(value: float | None) -> str:
        return "\N{EN DASH}" if value is None else f"{page_number(value / row.scale)} {row.unit}".removesuffix(" 1")

    of_all = "\N{EN DASH}"
    if row.lower is not None and row.upper is not None:
        refuted = row.verdict == "refuted"
        of_all = f"at most {percent_above(row.upper)}" if refuted else f"at least {percent_below(row.lower)}"
    return (
        row.requirement.text if first else "",
        ", ".join(f"{path} = {text}" for path, text in row.chosen.items()),
        _verdict(row),
        f"{row.cases:,}",
        f"{row.missed:,}",
        of_all,
        quantity(row.bound),
        f"{quantity(row.value)}, #{case}",
        quantity(row.margin),
        "\N{EN DASH}" if row.sigmas is None else f"{row.sigmas:.2f}",
    )


def _verdict(row: EvidenceRow) -> str:
    """The verdict, by which test, and what it takes: `not shown, 40 more cases`."""
    early = row.decided is not None and row.decided < row.cases
    parts = [f"{row.verdict} after {row.decided:,} cases" if early else row.verdict]
    parts += [f"{row.more:,} more cases"] * bool(row.more) + ["sequential test"] * row.sequential
    return ", ".join(parts)
