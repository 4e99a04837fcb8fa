#!/usr/bin/env python3
"""Packs the extension for VS Code, ic/editor/vscode, into one file that VS Code installs without a network.

    scripts/vsix.py met.vsix      writes a new file
    code --install-extension met.vsix

A .vsix is a ZIP file: the extension in the folder `extension`, its manifest, and the types of the files in it
(github.com/microsoft/vscode-vsce). Equal versions of MET make equal bytes. Only the standard library is used here.
"""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

FOLDER = Path(__file__).resolve().parents[1] / "ic" / "editor" / "vscode"
DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a ZIP file can hold: a build's clock is no part of it

_TYPES = {"json": "application/json", "js": "application/javascript", "vsixmanifest": "text/xml"}


def package() -> dict[str, object]:
    """The extension's own description, package.json."""
    described: dict[str, object] = json.loads((FOLDER / "package.json").read_text())
    return described


def files() -> dict[str, bytes]:
    """The files of a .vsix, by their names in it."""
    extension = {f"extension/{path.name}": path.read_bytes() for path in sorted(FOLDER.iterdir()) if path.is_file()}
    return {
        "extension.vsixmanifest": _manifest(package()).encode(),
        "[Content_Types].xml": _content_types().encode(),
        **extension,
    }


def vsix() -> bytes:
    """The whole extension."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files().items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return packed.getvalue()


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


def main(path: Path) -> int:
    """Write the extension to a new file. Returns the exit status: 2 where it cannot be written or exists."""
    try:
        with path.open("xb") as file:
            file.write(vsix())
    except FileExistsError:
        print(f"{path} exists: it is not written over; give another name, or remove it", file=sys.stderr)
        return 2
    except OSError as reason:
        print(f"cannot write {path}: {reason.strerror}", file=sys.stderr)
        return 2
    print(f"{path} is the extension for VS Code; `code --install-extension {path}` installs it")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])) if len(sys.argv) == 2 and sys.argv[1][0] != "-" else "scripts/vsix.py FILE.vsix")
