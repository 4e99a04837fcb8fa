"""Masters of FMUs by ctypes alone: FMI 3.0 and, smaller, FMI 2.0, for co-simulation."""

from __future__ import annotations

import ctypes
import io
import subprocess
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

MESSAGE = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Fmu:
    """An FMU from its bytes, unpacked into a folder; its binary is loaded.

    compiler  words of a command that compiles the sources anew; none: the binary inside
    """

    def __init__(self, data: bytes, folder: Path, compiler: tuple[str, ...] = ()) -> None:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.version = int(root.attrib["fmiVersion"][0])
        self.token = root.attrib["instantiationToken" if self.version == 3 else "guid"]
        variables = root.iter("Float64" if self.version == 3 else "ScalarVariable")
        self.attributes = {each.attrib["name"]: each.attrib for each in variables}
        self.references = {name: int(each["valueReference"]) for name, each in self.attributes.items()}
        self.outputs = [name for name, each in self.attributes.items() if each["causality"] == "output"]
        if compiler:
            path = folder / "fmu.so"
            subprocess.run(
                [*compiler, "-shared", "-fPIC", "-o", path, folder / "sources" / f"fmi{self.version}.c"], check=True
            )
        else:
            (path,) = (folder / "binaries").glob("*/*")
        self.called = ctypes.CDLL(str(path))
        if self.version == 3:
            self.called.fmi3InstantiateCoSimulation.restype = c_void_p
            self.called.fmi3GetVersion.restype = c_char_p
        else:
            self.called.fmi2Instantiate.restype = c_void_p
            self.called.fmi2GetVersion.restype = self.called.fmi2GetTypesPlatform.restype = c_char_p

    def instance(self, token: str | None = None, *, event_mode: bool = False) -> Instance:
        return Instance(self, self.token if token is None else token, event_mode=event_mode)


class Instance:
    """One instance of an FMU. Methods return the status; `messages` has what was logged."""

    def __init__(self, fmu: Fmu, token: str, *, event_mode: bool) -> None:
        self.fmu, self.messages = fmu, list[str]()
        self._message = MESSAGE(lambda environment, status, category, text: self.messages.append(text.decode()))
        self.handle = c_void_p(
            fmu.called.fmi3InstantiateCoSimulation(
                b"arm", token.encode(), None, False, False, event_mode, False, None, c_size_t(0), None,
                self._message, None,
            )
        )  # fmt: skip
        self.reached = 0.0

    def call(self, name: str, *words: object) -> int:
        return int(getattr(self.fmu.called, name)(self.handle, *words))

    def free(self) -> None:
        self.fmu.called.fmi3FreeInstance(self.handle)

    def enter(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call(
            "fmi3EnterInitializationMode",
            False,
            c_double(0.0),
            c_double(start),
            stop is not None,
            c_double(stop or 0.0),
        )

    def leave(self) -> int:
        return self.call("fmi3ExitInitializationMode")

    def begin(self, **values: float) -> None:
        """Set variables, with `__` for the dots of their names, and initialize."""
        for name, value in values.items():
            assert self.set(name.replace("__", "."), value) == OK
        assert self.enter() == OK and self.leave() == OK

    def _references(self, names: tuple[str | int, ...]) -> ctypes.Array[c_uint32]:
        return (c_uint32 * len(names))(*(self.fmu.references.get(str(n), n) for n in names))

    def set(self, name: str | int, value: float) -> int:
        return self.call("fmi3SetFloat64", self._references((name,)), c_size_t(1), byref(c_double(value)), c_size_t(1))

    def ask(self, *names: str | int) -> tuple[int, list[float]]:
        values = (c_double * len(names))()
        count = c_size_t(len(names))
        return self.call("fmi3GetFloat64", self._references(names), count, values, count), list(values)

    def get(self, *names: str | int) -> list[float]:
        status, values = self.ask(*names)
        assert status == OK, self.messages
        return values

    def step(self, time: float, size: float) -> int:
        event, end, early, reached = c_bool(True), c_bool(True), c_bool(True), c_double()
        words = byref(event), byref(end), byref(early), byref(reached)
        status = self.call("fmi3DoStep", c_double(time), c_double(size), True, *words)
        assert not (event.value or end.value or early.value)
        self.reached = reached.value
        return status

    def rows(self, times: np.ndarray) -> np.ndarray:
        """The outputs at these communication points, [point, output]; the first is where the instance is."""
        found = [self.get(*self.fmu.outputs)]
        for time, after in pairwise(times):
            assert self.step(time, after - time) == OK, self.messages
            found.append(self.get(*self.fmu.outputs))
        return np.array(found)

    # States

    def state(self) -> c_void_p:
        state = c_void_p()
        assert self.call("fmi3GetFMUState", byref(state)) == OK
        return state

    def go_back(self, state: c_void_p) -> int:
        return self.call("fmi3SetFMUState", state)

    def drop(self, state: c_void_p) -> None:
        assert self.call("fmi3FreeFMUState", byref(state)) == OK and not state

    def as_bytes(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call("fmi3SerializedFMUStateSize", state, byref(size)) == OK
        room = ctypes.create_string_buffer(size.value)
        assert self.call("fmi3SerializeFMUState", state, room, size) == OK
        return room.raw

    def from_bytes(self, data: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        return self.call("fmi3DeserializeFMUState", data, c_size_t(len(data)), byref(state)), state


LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    """The functions of a master of FMI 2.0."""

    _fields_ = (
        ("logger", LOGGER), ("allocate", c_void_p), ("release", c_void_p), ("finished", c_void_p),
        ("environment", c_void_p),
    )  # fmt: skip


class Instance2:
    """One instance of an FMU of FMI 2.0. Methods return the status; `messages` has what was logged."""

    def __init__(self, fmu: Fmu, token: str | None = None, kind: int = 1) -> None:
        self.fmu, self.messages = fmu, list[str]()
        self._callbacks = Callbacks(logger=LOGGER(lambda e, name, status, category, text: self._log(name, text)))
        self.handle = c_void_p(
            fmu.called.fmi2Instantiate(
                b"arm", kind, (token or fmu.token).encode(), None, byref(self._callbacks), False, False
            )
        )

    def _log(self, name: bytes, text: bytes) -> None:
        assert name == b"arm"
        self.messages.append(text.decode())

    def call(self, name: str, *words: object) -> int:
        return int(getattr(self.fmu.called, name)(self.handle, *words))

    def set_up(self, start: float = 0.0, stop: float | None = None) -> int:
        times = c_double(0.0), c_double(start), stop is not None, c_double(stop or 0.0)
        return self.call("fmi2SetupExperiment", False, *times)

    def set(self, name: str, value: float) -> int:
        return self.call("fmi2SetReal", byref(c_uint32(self.fmu.references[name])), c_size_t(1), byref(c_double(value)))

    def get(self, *names: str) -> list[float]:
        values, references = (c_double * len(names))(), (c_uint32 * len(names))(*map(self.fmu.references.get, names))
        assert self.call("fmi2GetReal", references, c_size_t(len(names)), values) == OK, self.messages
        return list(values)

    def step(self, time: float, size: float) -> int:
        return self.call("fmi2DoStep", c_double(time), c_double(size), True)
