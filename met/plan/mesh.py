"""Files with the surfaces of links, which pictures show."""

from __future__ import annotations

from met.frozen import frozen


@frozen
class Mesh:
    """A file with a link's surface: it is looked at, and never simulated.

    file, sha256     its name, as the deck's files are named, and the digest of its contents; "" where there was none
    at, rpy, scale   its frame in the link's, m and rad, and the factors along its axes, by which its numbers are metres
    """

    file: str
    sha256: str = ""
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
