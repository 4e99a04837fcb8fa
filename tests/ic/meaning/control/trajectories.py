"""A CSV file of moves, and a deck whose servo follows it: what the tests of trajectories and of CSV files share."""

from __future__ import annotations

from pathlib import Path

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, messages

MOVES = """\
time [s], hinge [deg], other [rad]
0,        0,           1
0.5,      30,          2
1,        45,          -3e-1
"""


def servo(course: str = 'trajectory(file = "moves.csv")') -> str:
    return changed(SERVO, ("rate(0.1 rad/s)", f"position({course})"), ("ki = 1", "k_position = 10 1/s; ki = 1"))


def shown(folder: Path, text: str | bytes | None, course: str = 'trajectory(file = "moves.csv")') -> str:
    """What is said of a deck with this CSV file beside it, without the counting line."""
    if text is not None:
        (folder / "moves.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    return messages(check(folder, ARM, servo(course), RUN)).rpartition("\n\n")[0] + "\n"
