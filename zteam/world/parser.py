"""Stage's .world language: a tree of entities, with includes and macros already worked in.

Grammar (NAME, NUMBER and STRING are tokens; a scalar or tuple stands on its property's line):

    file     := { 'include' STRING EOL | define | entity | property }
    define   := 'define' NAME NAME body          a macro of a model type, or of another macro
    entity   := NAME body                        a macro or a model type
    body     := '(' { entity | property } ')'
    property := NAME ( NUMBER | STRING | '[' { NUMBER | STRING } ']' )

A macro's body is replayed into the entity that uses it: a property set again wins, a nested entity is added. The
first definition of a macro stays. Every count is bounded, so that no file, however nested, takes long.
"""

from collections.abc import Iterator
from pathlib import Path

import msgspec

from zteam.errors import WorldError
from zteam.world.lexer import Kind, Token, read_tokens
from zteam.world.sources import Place, Remarks, find_file, read_text

MAX_TOKENS = 500_000
MAX_FILES = 256
MAX_CHARACTERS = 32 * 2**20
"""Of all included files."""
MAX_INCLUDE_DEPTH = 16
MAX_NESTING = 64
MAX_ENTITIES = 100_000
"""Entities of the whole world once macros are expanded."""
MAX_COPIES = 500_000
"""Properties and entities copied by macros."""

Value = float | str


class Property(msgspec.Struct, frozen=True):
    """`name value` or `name [ values ]`."""

    name: str
    values: tuple[Value, ...]
    is_tuple: bool
    place: Place


class Entity(msgspec.Struct):
    """`name ( … )` with its macros worked in. Children may be shared between entities: never change them."""

    name: str
    """As written: a macro or a type."""
    type: str
    """The type at the end of the chain of macros."""
    place: Place
    properties: dict[str, Property] = msgspec.field(default_factory=dict)
    children: list["Entity"] = msgspec.field(default_factory=list)
    count: int = 1
    """This entity and all below it."""
    depth: int = 1
    """Levels of entities, its own included."""


class Document(msgspec.Struct):
    """A parsed world file."""

    root: Entity
    """The file itself: world properties and top-level entities, of type `world`."""
    macros: dict[str, Entity]


def parse_world(path: Path, remarks: Remarks) -> Document:
    """Read a world file and what it includes; raises WorldError."""
    return _Parser(path.parent, remarks).parse(read_text(path), str(path), path)


def parse_text(text: str, remarks: Remarks, file: str = "<text>", folder: Path | None = None) -> Document:
    """Parse the text of a world whose includes are relative to `folder` (the working directory)."""
    return _Parser(folder or Path(), remarks).parse(text, file, None)


class _Parser:
    def __init__(self, folder: Path, remarks: Remarks) -> None:
        self._folder = folder
        self._remarks = remarks
        self._macros: dict[str, Entity] = {}
        self._open_files: list[Path] = []
        self._files = self._tokens = self._copies = self._characters = 0
        self._stream: Iterator[Token] = iter(())
        self._token = Token(Kind.EOF, None, Place("", 0, 0))

    def parse(self, text: str, file: str, path: Path | None) -> Document:
        root = Entity("world", "world", Place(file, 1, 1))
        self._parse_file(text, file, path, root)
        return Document(root, self._macros)

    # Tokens.

    def _advance(self) -> Token:
        """The current token; the next one becomes current."""
        token = self._token
        self._tokens += 1
        if self._tokens > MAX_TOKENS:
            raise token.place.error(f"more than {MAX_TOKENS} words and values: this world is refused")
        self._token = next(self._stream)
        return token

    def _skip_lines(self) -> None:
        while self._token.kind is Kind.EOL:
            self._advance()

    def _expect(self, kind: Kind, purpose: str) -> Token:
        if self._token.kind is not kind:
            raise self._token.place.error(f"expected {purpose}, found {self._token}")
        return self._advance()

    # Files.

    def _parse_file(self, text: str, file: str, path: Path | None, root: Entity) -> None:
        self._files += 1
        outer = self._stream, self._token
        if path is not None:
            self._open_files.append(path.resolve())
        self._stream = read_tokens(text, file)
        self._token = next(self._stream)
        while True:
            self._skip_lines()
            if self._token.kind is Kind.EOF:
                break
            name = self._expect(Kind.NAME, "a property, an entity, 'include' or 'define'")
            if name.value == "include":
                self._parse_include(name.place, root)
            elif name.value == "define":
                self._parse_define()
            else:
                self._parse_item(name, root, 1)
        self._stream, self._token = outer
        if path is not None:
            self._open_files.pop()

    def _parse_include(self, place: Place, root: Entity) -> None:
        name = self._expect(Kind.STRING, 'the name of the file to include, such as "map.inc"')
        if self._token.kind not in (Kind.EOL, Kind.EOF):
            raise self._token.place.error(f"an include ends its line, found {self._token}")
        path = find_file(str(name.value), self._folder)
        if path is None:
            raise name.place.error(f"included file {name} not found in {self._folder} or $STAGEPATH")
        if path.resolve() in self._open_files:
            raise name.place.error(f"{str(name.value)!r} includes itself")
        if len(self._open_files) > MAX_INCLUDE_DEPTH:
            raise name.place.error(f"includes nest deeper than {MAX_INCLUDE_DEPTH}")
        if self._files >= MAX_FILES:
            raise name.place.error(f"more than {MAX_FILES} files included")
        try:
            text = read_text(path)
        except WorldError as error:
            raise place.error(str(error)) from None
        self._characters += len(text)
        if self._characters > MAX_CHARACTERS:
            raise place.error(f"more than {MAX_CHARACTERS} characters in included files: this world is refused")
        self._parse_file(text, str(path), path, root)

    # Entities.

    def _parse_define(self) -> None:
        name = self._expect(Kind.NAME, "the macro's name")
        base = self._expect(Kind.NAME, f"the type or macro that {name} is made of")
        self._skip_lines()
        macro = self._parse_entity(base, str(name.value), 1)
        if str(name.value) in self._macros:
            self._remarks.add(name.place, f"macro {name} is defined already: the first definition stays")
        else:
            self._macros[str(name.value)] = macro

    def _parse_item(self, name: Token, owner: Entity, level: int) -> None:
        """An entity or a property of `owner`, whose name has been read."""
        if self._token.kind in (Kind.EOL, Kind.OPEN):
            # An entity's '(' may stand on a later line, a property's value may not.
            self._skip_lines()
            if self._token.kind is not Kind.OPEN:
                raise name.place.error(f"{name} has neither a value on its line nor a body in ( )")
            self._add_child(owner, self._parse_entity(name, str(name.value), level))
        else:
            owner.properties[str(name.value)] = self._parse_property(name)

    def _parse_entity(self, base: Token, name: str, level: int) -> Entity:
        if level > MAX_NESTING:
            raise base.place.error(f"entities nest deeper than {MAX_NESTING}")
        opening = self._expect(Kind.OPEN, "'('")
        entity = Entity(name, str(base.value), base.place)
        self._replay(self._macros.get(entity.type), entity)
        while True:
            self._skip_lines()
            if self._token.kind is Kind.CLOSE:
                self._advance()
                return entity
            if self._token.kind is Kind.EOF:
                raise opening.place.error("this '(' is never closed")
            item = self._expect(Kind.NAME, "a property, an entity or ')'")
            if item.value in ("include", "define"):
                raise item.place.error(f"{item} belongs at the top level of a file, not inside ( )")
            self._parse_item(item, entity, level + 1)

    def _replay(self, macro: Entity | None, entity: Entity) -> None:
        if macro is None:
            return
        self._copies += len(macro.properties) + len(macro.children)
        if self._copies > MAX_COPIES:
            raise entity.place.error("macros of macros grow beyond all bounds")
        entity.type = macro.type
        entity.properties.update(macro.properties)
        entity.children.extend(macro.children)
        entity.count, entity.depth = macro.count, macro.depth

    def _add_child(self, owner: Entity, child: Entity) -> None:
        owner.children.append(child)
        owner.count += child.count
        owner.depth = max(owner.depth, child.depth + 1)
        if owner.count > MAX_ENTITIES:
            raise child.place.error(f"more than {MAX_ENTITIES} entities once macros are expanded")
        if owner.depth > MAX_NESTING + 1:
            raise child.place.error(f"entities nest deeper than {MAX_NESTING} once macros are expanded")

    def _parse_property(self, name: Token) -> Property:
        if self._token.kind in (Kind.NUMBER, Kind.STRING):
            return Property(str(name.value), (_value(self._advance()),), False, name.place)
        if self._token.kind is not Kind.OPEN_TUPLE:
            raise self._token.place.error(f"expected the value of {name}, found {self._token}")
        self._advance()
        values: list[Value] = []
        while self._token.kind in (Kind.NUMBER, Kind.STRING):
            values.append(_value(self._advance()))
        self._expect(Kind.CLOSE_TUPLE, f"a number, a string or ']' on the line of {name}")
        return Property(str(name.value), tuple(values), True, name.place)


def _value(token: Token) -> Value:
    assert token.value is not None
    return token.value
