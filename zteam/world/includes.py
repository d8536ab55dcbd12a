"""All tokens of a world file, with those of its includes in their places.

An include is text in the place of its line, wherever that line stands: at the top level, in a model, in a macro. File
names are relative to the folder of the top file. Every count is bounded, so that no set of files takes long.
"""

from pathlib import Path

from zteam.errors import WorldError
from zteam.world.lexer import Kind, Token, read_tokens
from zteam.world.sources import Place, Remarks, find_file, read_text

MAX_TOKENS = 500_000
MAX_FILES = 256
MAX_CHARACTERS = 32 * 2**20
"""Of all included files."""
MAX_INCLUDE_DEPTH = 16


def read_world_tokens(text: str, file: str, folder: Path, remarks: Remarks, path: Path | None = None) -> list[Token]:
    """The tokens of `text`, EOF last; `path` is its file, if it has one. Raises WorldError."""
    splicer = _Splicer(folder, remarks)
    splicer.read(text, file, path)
    return splicer.tokens


class _Splicer:
    def __init__(self, folder: Path, remarks: Remarks) -> None:
        self.tokens: list[Token] = []
        self._folder = folder
        self._remarks = remarks
        self._open_files: list[Path] = []
        self._files = self._characters = 0

    def read(self, text: str, file: str, path: Path | None) -> None:
        """Append the tokens of a file; EOF only if it is the top file."""
        self._files += 1
        is_top = not self._open_files
        self._open_files.append(path.resolve() if path else Path(file))
        tokens = read_tokens(text, file, self._remarks)
        for token in tokens:
            if token.kind is Kind.NAME and token.value == "include":
                self._include(token.place, next(tokens))
            elif token.kind is not Kind.EOF or is_top:
                self._add(token)
        self._open_files.pop()

    def _add(self, token: Token) -> None:
        if len(self.tokens) >= MAX_TOKENS:
            raise token.place.error(f"more than {MAX_TOKENS} words and values: this world is refused")
        self.tokens.append(token)

    def _include(self, place: Place, name: Token) -> None:
        if name.kind is not Kind.STRING:
            text = f'expected the name of the file to include, such as "map.inc", found {name}'
            raise name.place.error(text)
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
        self.read(text, str(path), path)
        # The last line of the file may lack its end, and an include ends its own line.
        self._add(Token(Kind.EOL, None, name.place))
