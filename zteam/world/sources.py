"""World files as text: how they are found and read, and places in them."""

import codecs
import os
from pathlib import Path
from typing import NamedTuple

from zteam.errors import WorldError
from zteam.world.model import Remark

MAX_FILE_BYTES = 16 * 2**20


class Place(NamedTuple):
    """Where something stands in a world file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def error(self, text: str) -> WorldError:
        """The error that begins with this place."""
        return WorldError(f"{self}: {text}")


class Remarks:
    """What a file says that has no effect here: each place once, even if many models share its macro; at most 200."""

    LIMIT = 200

    def __init__(self) -> None:
        self._remarks: dict[tuple[Place, str], None] = {}

    @property
    def is_full(self) -> bool:
        """Whether the limit is reached."""
        return len(self._remarks) >= self.LIMIT

    def add(self, place: Place, text: str) -> None:
        """Note `text` unless it has been noted at this place."""
        if not self.is_full:
            self._remarks.setdefault((place, text))

    def all(self) -> tuple[Remark, ...]:
        """In the order of their discovery."""
        return tuple(Remark(*place, text) for place, text in self._remarks)


def find_file(name: str, folder: Path) -> Path | None:
    """A file that a world names: absolute, else in the world's `folder`, else in $STAGEPATH's folders.

    There it is looked for by base name, as Stage does, and by its whole name: an include that Stage finds there may
    name its own bitmaps, which Stage then finds beside it.
    """
    try:
        beside = folder / name  # an absolute name wins over the folder
        if beside.is_file():
            return beside
        for other in filter(None, os.environ.get("STAGEPATH", "").split(os.pathsep)):
            for candidate in (Path(other) / Path(name).name, Path(other) / name):
                if candidate.is_file():
                    return candidate
    except (OSError, ValueError):  # a name no file can have: too long, a NUL in it
        pass
    return None


def read_text(path: Path) -> str:
    """The text of a world file; raises WorldError without a place. Bytes that are not UTF-8 become U+FFFD."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise WorldError(f"{path}: cannot read this world file: {reason}") from None
    if len(data) > MAX_FILE_BYTES:
        raise WorldError(f"{path}: a world file of more than {MAX_FILE_BYTES // 2**20} MB is refused")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise WorldError(f"{path}: UTF-16 text; save it as UTF-8")
    return data.decode("utf-8-sig", "replace")
