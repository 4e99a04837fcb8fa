"""A linker from LLVM's WebAssembly object file to a module that runs, so that none has to be installed.

One object holds the whole program, so little is left to be done: constants and tables get addresses, which are written
where the code refers to them; memory, stack and exports are declared. The formats are those of the WebAssembly core
specification 2.0 and of "WebAssembly Object File Linking" (WebAssembly/tool-conventions, Linking.md).

Memory is: the stack, so that one that is too small ends in a trap; constants; and from `heap` on what a caller puts
there.
"""

from __future__ import annotations

from met.frozen import frozen

STACK = 1 << 19
"""Bytes of the stack: twice the most that `met.backends.llvm.entry` puts there."""

PAGE = 1 << 16

SITES = "met.fma"
"""Name of the module's own section that lists where it calls the fused multiply-add: for each call the bytes from the
one before, or from the module's beginning. A call there has three bytes, as `f64x2.relaxed_madd` has."""

_CUSTOM, _TYPE, _IMPORT, _FUNCTION, _MEMORY, _GLOBAL, _EXPORT, _CODE, _DATA = 0, 1, 2, 3, 5, 6, 7, 10, 11
_SYMBOLS, _SEGMENTS = 8, 5  # subsections of "linking"
_OF_FUNCTION, _OF_DATA, _OF_GLOBAL, _OF_SECTION = 0, 1, 2, 3  # kinds of symbols
_UNDEFINED, _EXPLICIT_NAME = 0x10, 0x40  # flags of symbols
_FUNCTION_INDEX, _ADDRESS, _SIGNED_ADDRESS, _WHOLE_ADDRESS, _GLOBAL_INDEX = 0, 3, 4, 5, 7  # kinds of relocations
_WITH_ADDEND = (_ADDRESS, _SIGNED_ADDRESS, _WHOLE_ADDRESS)
_CALL = 0x10
_PADDED = 5  # bytes that an object reserves for each number that a linker writes


@frozen
class LinkedModule:
    """A linked module; `heap` is the first free byte of memory, `fma_calls` the number of calls of the multiply-add."""

    code: bytes
    heap: int
    fma_calls: int


class _ByteReader:
    """Reader of an object file's bytes, from the start to the end."""

    def __init__(self, data: bytes, start: int = 0) -> None:
        self.data, self.position = data, start

    def byte(self) -> int:
        self.position += 1
        return self.data[self.position - 1]

    def take(self, count: int) -> bytes:
        self.position += count
        return self.data[self.position - count : self.position]

    def number(self) -> int:
        """Read an unsigned number, LEB128."""
        value = shift = 0
        while True:
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def signed(self) -> int:
        begun = self.position
        value, bits = self.number(), 7 * (self.position - begun)
        return value - (1 << bits) if value >> (bits - 1) else value

    def name(self) -> str:
        return self.take(self.number()).decode()


def number(value: int, width: int = 1) -> bytes:
    """An unsigned number as LEB128, of at least `width` bytes."""
    parts = [value & 0x7F]
    while value > 0x7F or len(parts) < width:
        value >>= 7
        parts.append(value & 0x7F)
    return bytes([*(part | 0x80 for part in parts[:-1]), parts[-1]])


def _signed(value: int) -> bytes:
    """A non-negative number as signed LEB128."""
    encoded = number(value)
    return number(value, len(encoded) + 1) if encoded[-1] & 0x40 else encoded


def _named(text: str) -> bytes:
    return number(len(text)) + text.encode()


@frozen
class _ObjectSymbol:
    """A symbol of an object: a function or a global by `index`; data at `offset` of the segment `index`."""

    kind: int
    name: str
    index: int
    offset: int = 0


@frozen
class _Relocation:
    """A number to be written at `at`, counted from the beginning of its section."""

    kind: int
    offset: int
    index: int
    addend: int


class _ObjectFile:
    """The parts of an object file."""

    def __init__(self, data: bytes) -> None:
        """Read an object file of LLVM's. Raises ValueError where it imports functions, or globals but the stack's
        pointer."""
        read = _ByteReader(data, 8)
        self.sections: dict[int, bytes] = {}
        self.symbols: list[_ObjectSymbol] = []
        self.alignments: list[int] = []
        self.relocations: dict[int, list[_Relocation]] = {}
        order: list[int] = []
        while read.position < len(data):
            kind = read.byte()
            body = read.take(read.number())
            order.append(kind)
            if kind != _CUSTOM:
                self.sections[kind] = body
                continue
            part = _ByteReader(body)
            name = part.name()
            if name == "linking":
                self._linking(part)
            elif name.startswith("reloc."):
                target = order[part.number()]
                self.relocations[target] = [self._relocation(part) for _ in range(part.number())]
        self._only_globals_and_memory()

    def _relocation(self, read: _ByteReader) -> _Relocation:
        kind, offset, index = read.byte(), read.number(), read.number()
        return _Relocation(kind, offset, index, read.signed() if kind in _WITH_ADDEND else 0)

    def _linking(self, read: _ByteReader) -> None:
        """Read the symbols and the alignments of data from the section `linking`."""
        read.number()  # version
        while read.position < len(read.data):
            kind = read.byte()
            part = _ByteReader(read.take(read.number()))
            if kind == _SYMBOLS:
                self.symbols = [self._symbol(part) for _ in range(part.number())]
            elif kind == _SEGMENTS:
                for _ in range(part.number()):
                    part.name()
                    self.alignments.append(1 << part.number())
                    part.number()  # flags

    def _symbol(self, read: _ByteReader) -> _ObjectSymbol:
        """Read one symbol. Raises ValueError for data that the object lacks."""
        kind, flags = read.byte(), read.number()
        if kind == _OF_DATA:
            name = read.name()
            if flags & _UNDEFINED:
                raise ValueError(f"the object lacks the data {name}")
            index, offset = read.number(), read.number()
            read.number()  # size
            return _ObjectSymbol(kind, name, index, offset)
        index = read.number()
        named = kind != _OF_SECTION and (not flags & _UNDEFINED or flags & _EXPLICIT_NAME)
        return _ObjectSymbol(kind, read.name() if named else "", index)

    def _only_globals_and_memory(self) -> None:
        """Raise ValueError where the object imports a function, or a global other than the stack's pointer: without
        such imports its numbers of functions and globals are the module's."""
        read = _ByteReader(self.sections.get(_IMPORT, b"\0"))
        for _ in range(read.number()):
            read.name()
            name, kind = read.name(), read.byte()
            if kind == 2:
                read.take(2 if read.data[read.position] == 0 else 3)
            elif kind == 3 and name == "__stack_pointer":
                read.take(2)
            else:
                raise ValueError(f"the object asks for {name}, which is nowhere")


def link(data: bytes, exported: str, fused: str) -> LinkedModule:
    """The module of an object file.

    exported  the function that callers may call
    fused     the function whose calls the section `SITES` lists
    Raises ValueError where the object needs more than it holds.
    """
    object_file = _ObjectFile(data)
    functions = {symbol.name: symbol.index for symbol in object_file.symbols if symbol.kind == _OF_FUNCTION}
    missing = {exported, fused} - functions.keys()
    if missing:
        raise ValueError(f"the object lacks the function {min(missing)}")
    places, segments, heap = _data(object_file)
    code, sites = _code(object_file, places, functions[fused])
    pages = -(-heap // PAGE)
    sections = [
        (_TYPE, object_file.sections[_TYPE]),
        (_FUNCTION, object_file.sections[_FUNCTION]),
        (_MEMORY, b"\1\0" + number(pages)),
        (_GLOBAL, b"\1\x7f\1\x41" + _signed(STACK) + b"\x0b"),
        (_EXPORT, b"\2" + _named("memory") + b"\2\0" + _named(exported) + b"\0" + number(functions[exported])),
        (_CODE, code),
        *([(_DATA, segments)] if segments else []),
    ]
    head, start = b"\0asm\1\0\0\0", 0
    for kind, body in sections:
        head += bytes([kind]) + number(len(body))
        if kind == _CODE:
            start = len(head)
        head += body
    steps = [b - a for a, b in zip([-start, *sites], sites, strict=False)]
    listed = _named(SITES) + b"".join(map(number, steps))
    return LinkedModule(head + bytes([_CUSTOM]) + number(len(listed)) + listed, heap, len(sites))


def _data(object_file: _ObjectFile) -> tuple[list[int], bytes, int]:
    """The address of each segment of data, the section of data, and the first byte after it, in whole cache lines."""
    read = _ByteReader(object_file.sections.get(_DATA, b"\0"))
    places, parts, address = [], [], STACK
    moved = {relocation.offset for relocation in object_file.relocations.get(_DATA, [])}
    if moved:
        raise ValueError("data of the object holds addresses")
    count = read.number()
    for alignment in object_file.alignments[:count]:
        if read.byte() != 0 or read.byte() != 0x41:
            raise ValueError("data of the object has no place in memory")
        read.signed()
        read.byte()  # end of the expression
        body = read.take(read.number())
        address = -(-address // alignment) * alignment
        places.append(address)
        parts.append(b"\0\x41" + _signed(address) + b"\x0b" + number(len(body)) + body)
        address += len(body)
    return places, number(count) + b"".join(parts) if count else b"", -(-address // 64) * 64


def _code(object_file: _ObjectFile, places: list[int], fused: int) -> tuple[bytes, list[int]]:
    """The section of code with its relocations applied, and the places in it where the function `fused` is called."""
    body = object_file.sections[_CODE]
    written = iter(sorted(object_file.relocations.get(_CODE, []), key=lambda relocation: relocation.offset))
    following = next(written, None)
    read = _ByteReader(body)
    count = read.number()
    bodies: list[tuple[bytes, list[int]]] = []
    for _ in range(count):
        size = read.number()
        end = read.position + size
        code, calls = bytearray(), []
        while following is not None and following.offset < end:
            code += read.take(following.offset - read.position)
            put = _written(object_file, following, places, fused)
            if (
                following.kind == _FUNCTION_INDEX
                and code[-1] == _CALL
                and object_file.symbols[following.index].index == fused
            ):
                calls.append(len(code) - 1)
            code += put
            read.position += _PADDED
            following = next(written, None)
        code += read.take(end - read.position)
        bodies.append((bytes(code), calls))
    out, sites = number(count), []
    for function, calls in bodies:
        out += number(len(function))
        sites += [len(out) + call for call in calls]
        out += function
    return out, sites


def _written(object_file: _ObjectFile, relocation: _Relocation, places: list[int], fused: int) -> bytes:
    """The number for a relocation, as short as it can be; in two bytes where `fused` is called."""
    symbol = object_file.symbols[relocation.index]
    if relocation.kind == _FUNCTION_INDEX:
        encoded = number(symbol.index, 2 if symbol.index == fused else 1)
        if symbol.index == fused and len(encoded) > 2:
            raise ValueError("the object has too many functions")
        return encoded
    if relocation.kind == _GLOBAL_INDEX:
        return number(symbol.index)
    if relocation.kind in (_ADDRESS, _SIGNED_ADDRESS):
        address = places[symbol.index] + symbol.offset + relocation.addend
        return number(address) if relocation.kind == _ADDRESS else _signed(address)
    raise ValueError(f"the object asks for a relocation of kind {relocation.kind}")
