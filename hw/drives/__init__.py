"""The host's side of drives on a CAN bus or on serial lines, one dialect a file.

To add one: write its file with a `CanDrive` (hw/drives/drive.py), add that to `DIALECTS`, and write the drive's side
of it in tests/hw/players, which the tests of every dialect are derived from.
"""

from collections.abc import Mapping, Sequence

from hw.drives.cia402 import Cia402Drive
from hw.drives.damiao import DamiaoDrive
from hw.drives.drive import CanDrive
from hw.drives.moteus import MoteusDrive
from hw.drives.odrive import OdriveDrive
from hw.drives.odrive_ascii import OdriveAsciiDrive
from hw.drives.robstride import RobstrideDrive

DIALECTS: Mapping[str, type[CanDrive]] = {
    drive.dialect: drive
    for drive in (OdriveDrive, DamiaoDrive, MoteusDrive, Cia402Drive, RobstrideDrive, OdriveAsciiDrive)
}

REFUSED: Mapping[str, Sequence[str]] = {
    "cubemars": (  # AK Series Actuator Driver Manual V1.0.8, 5.3
        "CubeMars' AK drives are not driven: their manual tells of no watchdog in MIT mode, and no answer of theirs "
        "says whether they drive",
        "a drive that goes on without its host is not armed, and no watchdog could be proved",
        "RobStride and Damiao have motors of that kind, with a watchdog: `robstride`, `damiao`",
    )
}
"""Known dialects whose drives are not driven: the message, and help."""
