"""All campaigns of faults on the bus, of ten thousand exchanges each: `python -m tests.hw.drives.campaigns`.

The tests run a fifth of the exchanges. A campaign prints a line: how many frames or lines the fault befell, how many
exchanges were answered, how many of the answers were wrong, and how often the bed stopped.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.hw.drives import test_faults, test_fdcanusb, test_odrive_ascii, test_rates
from tests.hw.drives.spoiling import FAULTS, Spoiler, Tally
from tests.hw.drives.test_fdcanusb import TEXT_FAULTS, TextSpoiler


def campaigns(folder: Path, exchanges: int) -> Iterator[tuple[str, str, Tally, Spoiler | TextSpoiler]]:
    """What is sent and to whom, the fault, and what came of it, of each campaign."""
    for dialect in test_faults.DIALECTS:
        for kind in FAULTS:
            yield f"torques {dialect}", kind, *test_faults.through(folder, dialect, kind, exchanges)
    for dialect in test_rates.TOLD:
        for kind in FAULTS:
            yield f"rates {dialect}", kind, *test_rates.through(folder, dialect, kind, exchanges)
    for name, through in (("fdcanusb", test_fdcanusb.through), ("odrive_ascii", test_odrive_ascii.through)):
        for kind in TEXT_FAULTS:
            yield f"lines {name}", kind, *through(folder, kind, exchanges)


def main() -> int:
    """The exit status is 1 where an answer was wrong."""
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        for sent, kind, tally, spoiler in campaigns(Path(name), 10_000):
            wrong += tally.wrong
            print(
                f"{sent:20} {kind:13} befell {spoiler.befell:6,} answered {tally.answered:6,} wrong {tally.wrong} "
                f"worst {tally.worst:.3f} rad/s stops {tally.stops} {tally.faults!r}",
                flush=True,
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
