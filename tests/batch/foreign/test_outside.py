"""An archive is one file: what HDF5 would follow out of it, or run for it, is refused by every reader of archives."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
from met.diagnostic import Problem
from tests.batch.foreign.archives import changed, met, readers, replaced

SECRET = "root:x:0:0:a secret of this machine"

HELPS = (
    " = help: nothing of it was read: an archive is one file, leads to no other, and runs nothing\n"
    " = help: ask whoever made it for the archive as `met run` wrote it\n"
    "\n1 error\n"
)

Trap = Callable[[Any, str], None]


def external(file: Any, other: str) -> None:
    """A deck's text that is another file."""

    def make() -> None:
        file["provenance"].create_dataset("source_text", (1,), f"S{len(SECRET)}", external=[(other, 0, len(SECRET))])

    replaced(file["provenance"], "source_text", make)


def virtual(file: Any, other: str) -> None:
    layout = h5py.VirtualLayout((5,), dtype="<f8")
    layout[:] = h5py.VirtualSource(other, "x", (5,))
    replaced(file["open"], "time", lambda: file["open"].create_virtual_dataset("time", layout))


def growing(file: Any, other: str) -> None:
    """A virtual dataset whose size follows from the file that it is of."""
    layout = h5py.VirtualLayout((5,), dtype="<f8", maxshape=(None,))
    all_of_it = slice(0, h5py.h5s.UNLIMITED)
    layout[all_of_it] = h5py.VirtualSource(other, "x", (5,), maxshape=(None,))[all_of_it]
    replaced(file["open"], "time", lambda: file["open"].create_virtual_dataset("time", layout))


def external_link(file: Any, other: str) -> None:
    file["open/q2"] = h5py.ExternalLink(other, "/q")


def soft_link(file: Any, other: str) -> None:
    file["open/q2"] = h5py.SoftLink("/open/q")


def hidden(file: Any, other: str) -> None:
    """Deep in a group that is none of an archive's."""
    file.create_group("notes/of/mine")["x"] = h5py.ExternalLink(other, "/q")


def of_a_group(file: Any, other: str) -> None:
    del file["open"]
    file["open"] = h5py.ExternalLink(other, "/open")


def filtered(file: Any, other: str) -> None:
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((5,))
    made.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, ())
    space = h5py.h5s.create_simple((5,))
    h5py.h5d.create(file["open"].id, b"packed", h5py.h5t.IEEE_F64LE, space, made)


def region(file: Any, other: str) -> None:
    file["open/part"] = file["open/q"].regionref[0]


def reference(file: Any, other: str) -> None:
    file["open"].attrs["other"] = file["open/q"].ref


def opaque(file: Any, other: str) -> None:
    file["open"].create_dataset("blob", data=np.void(b"any bytes"))


def ragged(file: Any, other: str) -> None:
    file["open"].create_dataset("ragged", (2,), h5py.vlen_dtype(np.float64))


def compound(file: Any, other: str) -> None:
    file["open/time"].attrs["pair"] = np.zeros(1, [("a", "<f8"), ("b", "<i4")])


def named_type(file: Any, other: str) -> None:
    file["open/kind"] = np.dtype("<f8")


def huge(file: Any, other: str) -> None:
    """Values that no file of this size has, and that would fill this machine's memory."""
    file["open"].create_dataset("many", (1 << 50,), "<f8", chunks=(1 << 20,))


TRAPS: dict[Trap, str] = {
    external: "`provenance/source_text` has its values in another file (external storage)",
    virtual: "`open/time` is put together from other files (a virtual dataset)",
    growing: "`open/time` is put together from other files (a virtual dataset)",
    external_link: "`open/q2` is a link to elsewhere",
    soft_link: "`open/q2` is a link to elsewhere",
    hidden: "`notes/of/mine/x` is a link to elsewhere",
    of_a_group: "`open` is a link to elsewhere",
    filtered: "`open/packed` is packed by other people's code (HDF5's filter 32015)",
    region: "`open/part` is neither of numbers nor of strings",
    reference: "`open:other` is neither of numbers nor of strings",
    opaque: "`open/blob` is neither of numbers nor of strings",
    ragged: "`open/ragged` is neither of numbers nor of strings",
    compound: "`open/time:pair` is neither of numbers nor of strings",
    named_type: "`open/kind` is a type of numbers by itself",
    huge: "`open/many` has more values than the file has room for",
}


@pytest.fixture
def secret(tmp_path: Path) -> str:
    path = tmp_path / "passwd"
    path.write_text(SECRET, encoding="utf-8")
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("trap", TRAPS, ids=lambda trap: trap.__name__)
def test_what_leads_out_of_an_archive_is_refused_by_its_name(
    trap: Trap, archive: Path, secret: str, tmp_path: Path
) -> None:
    with changed(archive, tmp_path) as (copy, file):
        trap(file, secret)
    said = met("show", str(copy))
    assert said.status == 2
    assert said.text == f"error[E308]: the archive {copy} holds what MET writes into none: {TRAPS[trap]}\n{HELPS}"


@pytest.mark.parametrize("trap", [external, virtual, growing, external_link, of_a_group], ids=lambda t: t.__name__)
def test_a_named_pipe_to_which_an_archive_leads_is_not_waited_for(trap: Trap, archive: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with changed(archive, tmp_path) as (copy, file):
        trap(file, str(tmp_path / "pipe"))
    said = met("show", str(copy))
    assert said.status == 2 and "error[E308]" in said.text


@pytest.mark.slow
def test_no_reader_of_archives_gives_out_a_file_of_this_machine(archive: Path, secret: str, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        external(file, secret)
    where = TRAPS[external]
    for name, words in readers(copy, tmp_path, archive).items():
        said = met(*words)
        assert said.status == 2, name
        assert SECRET not in said.text, name
        assert f"the archive {copy} holds what MET writes into none: {where}" in said.text, name
    left = [path for path in tmp_path.iterdir() if path.name not in ("passwd", "given.h5")]
    assert left == []


def test_nor_does_python(archive: Path, secret: str, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        external(file, secret)
    for ask in (batch.open, batch.look, lambda path: batch.diff(archive, path)):
        with pytest.raises(Problem) as caught:
            ask(copy)
        assert [each.code for each in caught.value.diagnostics] == ["E308"]


@pytest.mark.slow
def test_nor_does_data_met_of_what_xarray_has_opened(single: Path, secret: str, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, _):
        data = batch.open(copy)
    with h5py.File(copy, "r+") as file:
        external(file, secret)
    with data, pytest.raises(Problem) as caught:
        data.met.frames()
    assert [each.code for each in caught.value.diagnostics] == ["E308"]


def test_a_group_of_ones_own_in_an_archive_is_in_nobodys_way(single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        notes = file.create_group("notes")
        notes["said"] = "it squeaked"
        notes["again"] = notes
        notes.create_dataset("packed", data=np.zeros(100_000), compression="gzip", shuffle=True)
    assert met("show", str(copy)).status == 0


def test_no_library_is_loaded_because_a_file_names_its_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HDF5_PLUGIN_PRELOAD", raising=False)
    met("--version")
    assert os.environ["HDF5_PLUGIN_PRELOAD"] == "::"  # HDF5's word for: none at all
