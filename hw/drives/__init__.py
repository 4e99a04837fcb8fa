"""The host's side of drives on a CAN bus, one dialect a file.

To add one: write its file with a `CanDrive` (hw/drives/drive.py), add that to `DIALECTS`, and write the drive's side
of it in hw/players, which the tests of every dialect are derived from.
"""

from collections.abc import Mapping

from hw.drives.cia402 import Cia402Drive
from hw.drives.damiao import DamiaoDrive
from hw.drives.drive import CanDrive
from hw.drives.moteus import MoteusDrive
from hw.drives.odrive import OdriveDrive
from hw.drives.robstride import RobstrideDrive

DIALECTS: Mapping[str, type[CanDrive]] = {
    each.dialect: each for each in (OdriveDrive, DamiaoDrive, MoteusDrive, Cia402Drive, RobstrideDrive)
}
