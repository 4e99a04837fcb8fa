"""The extension for VS Code as one file, `met lsp --vscode FILE.vsix`: made without a network, from MET's own files.

A .vsix is a ZIP file: the extension in the folder `extension`, its manifest, and the types of the files in it
(github.com/microsoft/vscode-vsce). Equal versions of MET make equal bytes.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from met.host.files import open_regular

FOLDER = Path(__file__).parent / "vscode"
DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a ZIP file can hold: a build's clock is no part of it

MANIFEST = "extension.vsixmanifest"
MOST_OF_MANIFEST = 20_000  # number of its bytes that are searched

_TYPES = {"json": "application/json", "js": "application/javascript", "vsixmanifest": "text/xml"}


def package() -> dict[str, object]:
    """The extension's own description, package.json."""
    described: dict[str, object] = json.loads((FOLDER / "package.json").read_text())
    return described


def files() -> dict[str, bytes]:
    """The files of a .vsix, by their names in it."""
    found = {f"extension/{path.name}": path.read_bytes() for path in sorted(FOLDER.iterdir()) if path.is_file()}
    return {
        MANIFEST: _manifest(package()).encode(),
        "[Content_Types].xml": _content_types().encode(),
        **found,
    }


def vsix() -> bytes:
    """The whole extension."""
    made = BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files().items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return made.getvalue()


def is_extension(path: Path) -> bool:
    """True for a file of this extension, of any version of MET. Raises OSError."""
    own = f"Id={quoteattr(str(package()['name']))} "
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive, archive.open(MANIFEST) as manifest:
            return own.encode() in manifest.read(MOST_OF_MANIFEST)
    except (zipfile.BadZipFile, zlib.error, KeyError, RuntimeError, NotImplementedError):
        return False  # not a ZIP file, without a manifest, or unreadable


def _manifest(described: Mapping[str, object]) -> str:
    name, version, publisher = (quoteattr(str(described[key])) for key in ("name", "version", "publisher"))
    engines = described["engines"]
    assert isinstance(engines, dict)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<PackageManifest Version="2.0.0" xmlns="http://schemas.microsoft.com/developer/vsx-schema/2011">
  <Metadata>
    <Identity Language="en-US" Id={name} Version={version} Publisher={publisher}/>
    <DisplayName>{escape(str(described["displayName"]))}</DisplayName>
    <Description xml:space="preserve">{escape(str(described["description"]))}</Description>
    <Tags>met,ic</Tags>
    <Categories>Programming Languages</Categories>
    <GalleryFlags>Public</GalleryFlags>
    <Properties>
      <Property Id="Microsoft.VisualStudio.Code.Engine" Value={quoteattr(str(engines["vscode"]))}/>
    </Properties>
  </Metadata>
  <Installation>
    <InstallationTarget Id="Microsoft.VisualStudio.Code"/>
  </Installation>
  <Dependencies/>
  <Assets>
    <Asset Type="Microsoft.VisualStudio.Code.Manifest" Path="extension/package.json" Addressable="true"/>
  </Assets>
</PackageManifest>
"""


def _content_types() -> str:
    types = "".join(f'<Default Extension=".{end}" ContentType="{kind}"/>' for end, kind in _TYPES.items())
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        f'<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">{types}</Types>\n'
    )
