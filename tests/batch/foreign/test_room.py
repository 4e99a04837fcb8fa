"""A small archive stays small: what it unpacks to, and its strings, are counted before anything of it is read."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
from met.diagnostic import Problem
from tests.batch.foreign.archives import changed, met

STRING = h5py.string_dtype("utf-8")


def packed(file: Any, filters: int, data: bytes) -> None:
    """A chunk of five numbers that is these bytes, to be unpacked so many times."""
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((5,))
    for _ in range(filters):
        made.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (1,))
    space = h5py.h5s.create_simple((5,))
    node = h5py.h5d.create(file["open"].id, b"many", h5py.h5t.IEEE_F64LE, space, made)
    node.write_direct_chunk((0,), data)


def stacked(file: Any) -> None:
    packed(file, 2, zlib.compress(zlib.compress(bytes(40))))


def inflated(file: Any) -> None:
    packed(file, 1, zlib.compress(bytes(100_000)))


def no_stream(file: Any) -> None:
    packed(file, 1, b"these are no packed bytes")


def strings(file: Any, **how: Any) -> None:
    """A thousand strings, all of them the same few bytes of the file."""
    one = file["open"].create_dataset("one", (1,), STRING, chunks=(1,))
    one[0] = "x" * 10_000
    reference = one.id.read_direct_chunk((0,))[1]
    many = file["open"].create_dataset("many", (1000,), STRING, chunks=(1000,), **how)
    data = reference * 1000
    if how.get("shuffle"):
        data = np.frombuffer(data, np.uint8).reshape(-1, 16).T.tobytes()
    many.id.write_direct_chunk((0,), zlib.compress(data) if how else data)


def packed_strings(file: Any) -> None:
    strings(file, compression="gzip", shuffle=True)


def unwritten(file: Any) -> None:
    """Numbers of which none is in the file, which is large for other reasons."""
    file["open"].create_dataset("many", (1 << 19,), "<f8", chunks=(1 << 10,))


def nested(file: Any) -> None:
    """Groups in groups."""
    file["open"].create_group("many" + "/many" * 70)


TRAPS: dict[Callable[[Any], None], str] = {
    stacked: "is packed twice over",
    inflated: "has a chunk that is packed to more than it should hold",
    no_stream: "has a chunk that is packed to more than it should hold",
    strings: "has more letters than the file has room for",
    packed_strings: "has more letters than the file has room for",
    unwritten: "has more values than the file has room for",
}


@pytest.mark.parametrize("trap", TRAPS, ids=lambda trap: trap.__name__)
def test_a_small_file_that_would_fill_the_memory_is_refused(
    trap: Callable[[Any], None], archive: Path, tmp_path: Path
) -> None:
    with changed(archive, tmp_path) as (copy, file):
        trap(file)
    said = met("show", str(copy))
    assert said.status == 2
    assert said.text == (
        f"error[E308]: the archive {copy} holds what MET writes into none: `open/many` {TRAPS[trap]}\n"
        " = help: nothing of it was read: an archive is one file, leads to no other, and runs nothing\n"
        " = help: ask whoever made it for the archive as `met run` wrote it\n"
        "\n1 error\n"
    )


@pytest.mark.release
@pytest.mark.parametrize(
    "how",
    [
        {"compression": "gzip"},
        {"compression": "gzip", "shuffle": True, "fletcher32": True},
        {"fletcher32": True},
        {"chunks": (2,)},
        {},
    ],
    ids=str,
)
def test_an_archive_that_somebody_has_packed_is_shown_as_before(
    how: dict[str, Any], archive: Path, tmp_path: Path
) -> None:
    with changed(archive, tmp_path) as (copy, file):
        notes = file.create_group("open/notes")
        words = {name: word for name, word in how.items() if name != "fletcher32"}  # HDF5 has no checksum of strings
        notes.create_dataset("words", data=np.array(["a", "of two", "x" * 5000], object), dtype=STRING, **words)
        notes.create_dataset("numbers", data=np.random.default_rng(1).random(3000), **how)
    assert met("show", str(copy)).status == 0


def test_strings_are_counted_in_a_file_with_a_foreword(archive: Path, tmp_path: Path) -> None:
    """HDF5 lets a file begin with anything of 512 bytes and more: places in it are counted from there."""
    with changed(archive, tmp_path) as (copy, file):
        size = len(file["provenance/source_text"])
    copy.write_bytes(bytes(512) + copy.read_bytes())
    with h5py.File(copy) as file:
        node = file["provenance/source_text"].id
        data = copy.read_bytes()
        at = node.get_offset()
        lengths = np.frombuffer(data[at : at + 16 * size], "<u4")[::4]
        assert lengths.tolist() == [len(text) for text in file["provenance/source_text"][...]]


def test_a_heap_of_strings_with_a_gap_of_no_bytes_is_told_and_not_walked_for_ever(
    archive: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "given.h5"
    data = bytearray(archive.read_bytes())
    at = data.index(b"GCOL") + 16
    data[at : at + 64] = bytes(64)
    copy.write_bytes(data)
    said = met("show", str(copy))
    assert said.status == 2
    assert said.text == (
        f"error[E302]: the archive {copy} is damaged: its strings are not where they should be\n"
        " = help: an archive that MET writes has its name only when it is whole: was this one copied in part?\n"
        "\n1 error\n"
    )


def test_an_attribute_that_xarray_cannot_read_is_told_by_its_archive(single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        file["status"].attrs["coordinates"] = np.zeros(3)
    with pytest.raises(Problem) as caught:
        batch.open(copy)
    assert [each.code for each in caught.value.diagnostics] == ["E302"]


@pytest.mark.parametrize("units", [np.bytes_("x" * 60_000), np.zeros(8000)], ids=["a word", "numbers"])
def test_a_unit_that_would_fill_a_picture_is_refused(units: Any, single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        file["end"].attrs["units"] = units
    said = met("plot", str(copy), "-o", str(tmp_path / "a.svg"))
    assert said.status == 2
    assert said.text == (
        f"error[E302]: the archive {copy} is damaged: variable `end` has more words than there can be\n"
        " = help: an archive that MET writes has its name only when it is whole: was this one copied in part?\n"
        "\n1 error\n"
    )


def test_groups_within_groups_are_followed_so_far_and_no_further(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        nested(file)
    said = met("show", str(copy))
    assert said.status == 2 and "many/many` is in more than 64 groups, one in another\n" in said.text


def test_thousands_of_attributes_are_not_looked_through(single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        for number in range(1, 1002):
            file["repeat"].attrs[f"a{number}"] = number
        count = len(file["repeat"].attrs)
    said = met("show", str(copy))
    assert (said.status, said.text.splitlines()[0]) == (
        2,
        f"error[E308]: the archive {copy} holds what MET writes into none: `repeat` has {count:,} attributes",
    )


def test_a_role_that_is_no_word_is_told(single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        file["end"].attrs["role"] = np.zeros(3)
    said = met("show", str(copy))
    assert said.status == 2
    message = "variable `end` has a role that is no word"
    assert said.text.startswith(f"error[E302]: the archive {copy} is damaged: {message}\n")
