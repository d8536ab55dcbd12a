"""Loads the object code that a compiler has made (ELF for x86-64) into this process, without the compiler.

numba's own way to load compiled code imports the compiler, which takes a second and a hundred megabytes.
"""

import ctypes
import mmap
import struct
import sys
from collections.abc import Callable, Iterator

import msgspec

_HEADER = struct.Struct("<16sHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_RELOCATION = struct.Struct("<QQq")
_WORD = struct.Struct("<Q")

_IDENTITY = b"\x7fELF\x02\x01\x01"
"""64 bits, little-endian, version 1."""
_RELOCATABLE, _X86_64 = 1, 62
_PROGBITS, _SYMTAB, _RELA, _NOTE, _NOBITS, _UNWIND = 1, 2, 4, 7, 8, 0x70000001
_ALLOC, _EXEC, _THREAD_LOCAL = 2, 4, 0x400
_INDIRECT = 10
"""Type of a symbol that is a function that finds the symbol's address."""
_UNDEFINED, _ABSOLUTE, _COMMON = 0, 0xFFF1, 0xFFF2
_R_64, _R_PC64 = 1, 24


class ObjectCodeError(Exception):
    """The code is of a kind that cannot be loaded here."""


class _Section(msgspec.Struct):
    name: int
    type: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    align: int
    entry_size: int


class ObjectCode:
    """Loaded code. It stays loaded, because functions of it may be in use until the process ends."""

    def __init__(self, data: bytes, find: Callable[[str], int]) -> None:
        """`find(symbol)` gives the address of what the code uses. Raises ObjectCodeError."""
        if sys.platform != "linux":
            # Another system passes arguments in its own way, in the same form of file.
            raise ObjectCodeError(f"it cannot be loaded on {sys.platform}")
        self._data = data
        try:
            self._load(find)
        except (struct.error, ValueError, IndexError, OverflowError, OSError) as error:
            raise ObjectCodeError(f"it is damaged: {error}") from None

    def _load(self, find: Callable[[str], int]) -> None:
        self._sections = list(self._read_sections())
        table = next((section for section in self._sections if section.type == _SYMTAB), None)
        if table is None:
            raise ObjectCodeError("it has no symbols")
        self._symbols = list(_SYMBOL.iter_unpack(self._bytes(table)))
        if any(symbol[1] & 0xF == _INDIRECT for symbol in self._symbols):
            raise ObjectCodeError("it chooses functions when it is loaded")
        self._names = self._sections[table.link]
        # Code first: from the next page on the memory can be written to.
        placed = sorted((s for s in self._sections if _is_placed(s)), key=lambda s: not s.flags & _EXEC)
        self._place(placed)
        self.addresses = [self._address_of(symbol, find) for symbol in self._symbols]
        self._relocate()
        self._protect()

    def find(self, name: str) -> int:
        """Address of a symbol. Raises ObjectCodeError."""
        for symbol, address in zip(self._symbols, self.addresses, strict=True):
            if symbol[3] != _UNDEFINED and self._name(symbol[0]) == name:
                return address
        raise ObjectCodeError(f"it has no {name}")

    def _read_sections(self) -> Iterator[_Section]:
        header = _HEADER.unpack_from(self._data)
        if not header[0].startswith(_IDENTITY) or header[1:3] != (_RELOCATABLE, _X86_64):
            raise ObjectCodeError("it is no object code for x86-64")
        for number in range(header[12]):
            yield _Section(*_SECTION.unpack_from(self._data, header[6] + number * header[11]))

    def _bytes(self, section: _Section) -> bytes:
        found = self._data[section.offset : section.offset + section.size]
        if len(found) != section.size:
            raise ObjectCodeError("it is cut")
        return found

    def _name(self, offset: int) -> str:
        begin = self._names.offset + offset
        return self._data[begin : self._data.index(b"\0", begin)].decode()

    def _place(self, placed: list[_Section]) -> None:
        """Copy the sections into memory of this process, and set their addresses."""
        end, self._code_size = 0, 0
        offsets = []
        for section in placed:
            if not section.flags & _EXEC and not self._code_size:
                end = self._code_size = _aligned(end, mmap.PAGESIZE)
            offsets.append(_aligned(end, max(1, section.align)))
            end = offsets[-1] + section.size
        self._commons = _aligned(end, 16)
        common = sum(_aligned(symbol[5], 16) for symbol in self._symbols if symbol[3] == _COMMON)
        # Private: a forked child gets data of its own.
        self._memory = mmap.mmap(-1, max(1, self._commons + common), mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._base = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self._commons += self._base
        for section, offset in zip(placed, offsets, strict=True):
            section.address = self._base + offset
            if section.type != _NOBITS:
                self._memory[offset : offset + section.size] = self._bytes(section)

    def _address_of(self, symbol: tuple[int, ...], find: Callable[[str], int]) -> int:
        name, _, _, index, value, size = symbol
        if index == _UNDEFINED:
            return find(self._name(name)) if name else 0
        if index == _ABSOLUTE:
            return value
        if index == _COMMON:
            address, self._commons = self._commons, self._commons + _aligned(size, 16)
            return address
        return self._sections[index].address + value

    def _relocate(self) -> None:
        for relocations in self._sections:
            if relocations.type != _RELA or not _is_placed(target := self._sections[relocations.info]):
                continue
            for offset, info, addend in _RELOCATION.iter_unpack(self._bytes(relocations)):
                kind, number = info & 0xFFFFFFFF, info >> 32
                if offset + _WORD.size > target.size:
                    raise ObjectCodeError("a relocation lies outside of its section")
                index = self._symbols[number][3]
                if 0 < index < len(self._sections) and not _is_placed(self._sections[index]):
                    raise ObjectCodeError("it uses a section that is not loaded")
                place = target.address + offset
                value = self.addresses[number] + addend
                if kind == _R_PC64:
                    value -= place
                elif kind != _R_64:
                    raise ObjectCodeError(f"relocation {kind} is not known")
                _WORD.pack_into(self._memory, place - self._base, value % 2**64)

    def _protect(self) -> None:
        mprotect = ctypes.CDLL(None, use_errno=True).mprotect
        mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        if self._code_size and mprotect(self._base, self._code_size, mmap.PROT_READ | mmap.PROT_EXEC):
            raise ObjectCodeError("this system lets no new code run")


def _is_placed(section: _Section) -> bool:
    """Whether it becomes part of the memory. Raises ObjectCodeError for what would need more than a copy."""
    if not section.flags & _ALLOC or section.type in (_NOTE, _UNWIND):
        # For debuggers, and for exceptions of C++.
        return False
    if section.type not in (_PROGBITS, _NOBITS) or section.flags & _THREAD_LOCAL:
        raise ObjectCodeError(f"a section of type {section.type} with flags {section.flags} is not known")
    return True


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size
