"""The cache of machine code: whose it is, what is part of an entry's name, and what is made anew."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met.backends.llvm import kernel
from met.host import cache
from met.host.cache import folder
from met.trace.program import Phase, Program, RunPhase
from tests.met.test_kernel import machine_like_program


def answer(value):
    body = Phase("p", lambda t: t.output("x", t.input("x") + value))
    return Program(1.0, (), (), (RunPhase(body),), ("x",), 0, ("x",))


def outcome(program):
    k = kernel.compile(program)
    return k.run(np.array([[1.0]]), 0)[1][0, 0], k.cached


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_an_edited_model_is_never_yesterdays_code(empty_cache):
    assert outcome(answer(1.0)) == (2.0, False)
    assert outcome(answer(1.0)) == (2.0, True)
    assert outcome(answer(2.0)) == (3.0, False)
    assert outcome(answer(1.0)) == (2.0, True)


def test_what_code_is_made_for_is_part_of_its_name(empty_cache):
    program = answer(1.0)
    assert not kernel.compile(program).cached
    assert not kernel.compile(program, 2).cached
    assert not kernel.compile(program, cpu="haswell").cached
    assert not kernel.compile(program, level=1).cached
    assert kernel.compile(program).cached


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[:-7],
        lambda data: b"?" * len(data),
        lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:],
    ],
)
def test_a_damaged_entry_is_made_anew(empty_cache, damage):
    outcome(answer(1.0))
    (path,) = folder().glob("*/*.o")
    path.write_bytes(damage(path.read_bytes()))
    assert outcome(answer(1.0)) == (2.0, False)
    assert outcome(answer(1.0)) == (2.0, True)


def test_a_cache_that_cannot_be_written_is_done_without(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "file"))
    assert outcome(answer(1.0)) == (2.0, False)
    assert outcome(answer(1.0)) == (2.0, False)


def by_another_user(entry, monkeypatch):
    fstat = os.fstat
    monkeypatch.setattr(os, "fstat", lambda file: os.stat_result([*fstat(file)[:4], 12345, *fstat(file)[5:]]))


def others_may_write_it(entry, monkeypatch):
    entry.chmod(0o622)


def others_may_write_its_folder(entry, monkeypatch):
    entry.parent.chmod(0o777)


@pytest.mark.parametrize(
    "spoil, told, why",
    [
        (by_another_user, "*/*.o", "it is another user's"),
        (others_may_write_it, "*/*.o", "others may write it"),
        (others_may_write_its_folder, "*", "others may write it"),
    ],
)
def test_what_another_user_may_have_written_is_not_run_and_told(empty_cache, monkeypatch, capsys, spoil, told, why):
    cache._tell.cache_clear()
    assert outcome(answer(1.0)) == (2.0, False)
    (entry,) = folder().glob("*/*.o")
    (place,) = folder().glob(told)
    with monkeypatch.context() as patch:
        spoil(entry, patch)
        assert outcome(answer(1.0)) == (2.0, False)
    assert capsys.readouterr().err == (
        f"met: {place} of the cache is not used: {why}; what is in it is compiled anew (MET_CACHE_DIR names another "
        "cache)\n"
    )


def test_a_cache_of_another_user_is_not_used(empty_cache, monkeypatch, capsys):
    cache._tell.cache_clear()
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert outcome(answer(1.0)) == outcome(answer(1.0)) == (2.0, False)
    assert capsys.readouterr().err == (
        f"met: {empty_cache} of the cache is not used: it is another user's; what is in it is compiled anew "
        "(MET_CACHE_DIR names another cache)\n"
    )
    assert not list(empty_cache.iterdir())


def test_an_entry_under_another_name_is_made_anew(empty_cache):
    outcome(answer(1.0))
    (one,) = folder().glob("*/*.o")
    outcome(answer(2.0))
    (other,) = set(folder().glob("*/*.o")) - {one}
    other.write_bytes(one.read_bytes())
    assert outcome(answer(2.0)) == (3.0, False)


@pytest.mark.parametrize(
    "home, base, expected",
    [
        ("/h", "", "/h/.cache/met"),
        ("/h", "/x", "/x/met"),
        ("/h", "x", "/h/.cache/met"),
        ("", "/x", "/x/met"),
        ("", "", "/own/.cache/met"),
        ("h", "", "/own/.cache/met"),
    ],
)
def test_where_the_cache_is(monkeypatch, home, base, expected):
    monkeypatch.delenv("MET_CACHE_DIR", raising=False)
    monkeypatch.setenv("HOME", home)
    monkeypatch.setenv("XDG_CACHE_HOME", base)
    monkeypatch.setattr(cache.pwd, "getpwuid", lambda _: SimpleNamespace(pw_dir="/own"))
    assert folder() == Path(expected)


def test_who_has_no_home_has_no_cache(monkeypatch):
    def unknown(_):
        raise KeyError

    monkeypatch.delenv("MET_CACHE_DIR", raising=False)
    monkeypatch.setenv("HOME", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(cache.pwd, "getpwuid", unknown)
    assert folder() is None
    assert outcome(answer(1.0)) == (2.0, False)


def _write_many(_):
    return [outcome(answer(float(i)))[0] for i in range(5)]


@pytest.mark.release
def test_many_processes_may_share_a_cache(empty_cache):
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        assert pool.map(_write_many, range(8)) == [[1.0 + i for i in range(5)]] * 8
    assert len(list(folder().glob("*/*.o"))) == 5
    assert not list(folder().glob("*/.new-*"))


def test_a_hit_loads_without_the_optimiser(empty_cache, monkeypatch):
    from met.backends.llvm import machine as llvm

    program = machine_like_program()
    kernel.compile(program)
    monkeypatch.setattr(llvm, "assemble", lambda *_, **__: pytest.fail("assembled"))
    assert kernel.compile(program).cached
