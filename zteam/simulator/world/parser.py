"""Stage's .world language: a tree of entities, with includes and macros expanded.

Grammar (NAME, NUMBER and STRING are tokens, includes are tokens of the file already; a scalar or tuple stands on its
property's line):

    file     := { define | entity | property }
    define   := 'define' NAME NAME body          a macro of a model type, or of another macro
    entity   := NAME body                        a macro or a model type
    body     := '(' { entity | property } ')'
    property := NAME ( NUMBER | STRING | '[' { NUMBER | STRING } ']' )

A macro is text: a definition is kept as it stands, and is parsed where it is used, with the macros known there. Its
body is replayed into the entity that uses it: a property set again wins, a nested entity is added. The first
definition of a macro stays. Every count is bounded, so that no file, however nested, takes long.
"""

from pathlib import Path
from typing import NamedTuple

import msgspec

from zteam.simulator.world.text import Remarks, TextPlace, Token, TokenKind, read_text, splice

MAX_STEPS = 3_000_000
"""Tokens parsed, those of a macro as often as it is used."""
MAX_NESTING = 64
MAX_ENTITIES = 100_000
"""Entities of the whole world once macros are expanded."""

Value = float | str
_VALUES = (TokenKind.NUMBER, TokenKind.STRING)


class Property(msgspec.Struct, frozen=True):
    """`name value` or `name [ values ]`."""

    name: str
    values: tuple[Value, ...]
    place: TextPlace
    written: tuple[str, ...]
    """The values as the file has them: Stage takes a number for text where it expects text."""


class Entity(msgspec.Struct):
    """`name ( … )` with its macros expanded."""

    name: str
    """As written: a macro or a type."""
    type: str
    """The type at the end of the chain of macros."""
    place: TextPlace
    properties: dict[str, Property] = msgspec.field(default_factory=dict)
    children: list["Entity"] = msgspec.field(default_factory=list)


class Macro(NamedTuple):
    base: str
    """The type or macro that it is defined by."""
    place: TextPlace
    body: int
    """Where its '(' is among the tokens."""


def parse_world(path: Path, remarks: Remarks) -> "Document":
    """Read a world file and its includes; raises WorldError."""
    return parse_text(read_text(path), remarks, str(path), path)


def parse_text(text: str, remarks: Remarks, file: str, path: Path | None = None) -> "Document":
    """Parse the text of a world, of the file at `path`, or with includes relative to the working directory."""
    return Document(splice(text, file, path, path.parent if path else Path(), remarks), file, remarks)


class Document:
    def __init__(self, tokens: list[Token], file: str, remarks: Remarks) -> None:
        self.root = Entity("world", "world", TextPlace(file, 1, 1))
        """The file itself: world properties and top-level entities, of type `world`."""
        self.macros: dict[str, Macro] = {}
        self._tokens = tokens
        self._remarks = remarks
        self._at = self._steps = self._entities = 0
        self._parse()

    def type_of(self, macro: str) -> str:
        """The type at the end of a macro's chain; a macro that is defined by itself has none."""
        seen = set()
        while macro in self.macros and macro not in seen:
            seen.add(macro)
            macro = self.macros[macro].base
        return "" if macro in seen else macro

    def expand(self, macro: str) -> Entity:
        """The entity that `macro ( )` at the end of the file gives; raises WorldError."""
        self._steps = self._entities = 0
        entity = Entity(macro, macro, self.macros[macro].place)
        self._replay_macros(entity, 1)
        return entity

    def _parse(self) -> None:
        while True:
            self._skip_lines()
            if self._token.kind is TokenKind.EOF:
                return
            name = self._expect(TokenKind.NAME, "a property, an entity, 'include' or 'define'")
            if name.written == "define":
                self._parse_define()
            else:
                self._parse_item(name, self.root, 1)

    @property
    def _token(self) -> Token:
        return self._tokens[self._at]

    def _advance(self) -> Token:
        """The current token; the next one becomes current."""
        token = self._token
        self._steps += 1
        if self._steps > MAX_STEPS:
            raise token.place.error("macros of macros grow beyond all bounds")
        self._at += 1
        return token

    def _skip_lines(self) -> None:
        while self._token.kind is TokenKind.EOL:
            self._advance()

    def _expect(self, kind: TokenKind, purpose: str) -> Token:
        if self._token.kind is not kind:
            raise self._token.place.error(f"expected {purpose}, found {self._token}")
        return self._advance()

    def _parse_define(self) -> None:
        self._skip_lines()
        name = self._expect(TokenKind.NAME, "the macro's name")
        self._skip_lines()
        base = self._expect(TokenKind.NAME, f"the type or macro that {name} is made of")
        self._skip_lines()
        macro = Macro(base.written, name.place, self._at)
        # Like Stage, look only for the ')' that belongs to the '('.
        opening = self._expect(TokenKind.OPEN, "'('")
        depth = 1
        while depth:
            kind = self._advance().kind
            if kind is TokenKind.EOF:
                raise opening.place.error("this '(' is never closed")
            depth += (kind is TokenKind.OPEN) - (kind is TokenKind.CLOSE)
        if name.written in self.macros:
            self._remarks.add(name.place, f"macro {name} is defined already: the first definition stays")
        else:
            self.macros[name.written] = macro

    def _parse_item(self, name: Token, owner: Entity, level: int) -> None:
        """Parse an entity or a property of `owner` after its name."""
        if self._token.kind in (TokenKind.EOL, TokenKind.OPEN):
            # An entity's '(' may stand on a later line, a property's value may not.
            self._skip_lines()
            if self._token.kind is not TokenKind.OPEN:
                raise name.place.error(f"{name} has neither a value on its line nor a body in ( )")
            owner.children.append(self._parse_entity(name, level))
        else:
            owner.properties[name.written] = self._parse_property(name)

    def _parse_entity(self, name: Token, level: int) -> Entity:
        if level > MAX_NESTING:
            raise name.place.error(f"entities nest deeper than {MAX_NESTING}, macros worked in")
        self._entities += 1
        if self._entities > MAX_ENTITIES:
            raise name.place.error(f"more than {MAX_ENTITIES} entities once macros are expanded")
        entity = Entity(name.written, name.written, name.place)
        self._replay_macros(entity, level)
        self._parse_body(entity, level)
        return entity

    def _replay_macros(self, entity: Entity, level: int) -> None:
        """Parse the bodies of the macro that the entity is of, the innermost first."""
        chain: dict[str, int] = {}
        while entity.type in self.macros:
            if entity.type in chain:
                raise entity.place.error(f"macro {entity.type!r:.60} is made of itself")
            macro = self.macros[entity.type]
            chain[entity.type] = macro.body
            entity.type = macro.base
        back = self._at
        for body in reversed(chain.values()):
            self._at = body
            self._parse_body(entity, level)
        self._at = back

    def _parse_body(self, entity: Entity, level: int) -> None:
        opening = self._expect(TokenKind.OPEN, "'('")
        while True:
            self._skip_lines()
            if self._token.kind is TokenKind.CLOSE:
                self._advance()
                return
            if self._token.kind is TokenKind.EOF:
                raise opening.place.error("this '(' is never closed")
            item = self._expect(TokenKind.NAME, "a property, an entity or ')'")
            if item.written == "define":
                raise item.place.error("'define' belongs at the top level of a file, not inside ( )")
            self._parse_item(item, entity, level + 1)

    def _parse_property(self, name: Token) -> Property:
        tokens: list[Token] = []
        if self._token.kind in _VALUES:
            tokens.append(self._advance())
        elif self._token.kind is TokenKind.OPEN_TUPLE:
            self._advance()
            while self._token.kind in _VALUES:
                tokens.append(self._advance())
            self._expect(TokenKind.CLOSE_TUPLE, f"a number, a string or ']' on the line of {name}")
        else:
            hint = "; text needs quotes" if self._token.kind is TokenKind.NAME else ""
            raise self._token.place.error(f"expected the value of {name}, found {self._token}{hint}")
        values, written = tuple(token.value for token in tokens), tuple(token.written for token in tokens)
        return Property(name.written, values, name.place, written)
