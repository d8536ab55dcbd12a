"""Files of other programs, known by what is in them, and named as such where a world, a map or a team is read."""

import codecs
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from zteam.errors import UsageError

_WORLDS = "zteam reads worlds of Stage and maps of map_server, and 'zteam world new PLAN.png' makes a world of a plan"
MAP_FILE = r'^(?:\{.*)?"?(?:image|resolution)"?\s*:'
YAML_FILE = r"\A(?:---\s|\{|[\w/*]+:\s)"
TEAM_FILE = r"^\[+[ \t]*(?:team|robots|nodes|defaults|simulation)\b"
_HEADS = {
    r"\x89PNG|P[1-6]\s+(?:#[^\n]*\n\s*)*\d+\s+\d|\xff\xd8\xff|GIF8[79]a|BM.{4}\0{4}": (
        "a picture", "'zteam world new {} --resolution METRES' makes a world of it"),
    r"PK\x03\x04|\x1f\x8b|BZh\d1AY&SY|7z\xbc\xaf|\xfd7zXZ|\x28\xb5\x2f\xfd|Rar!|.{257}ustar *\0": (
        "a packed file", "unpack it, and name the file that was in it"),
    r"%PDF-|AC10\d\d\0|\s*(?:999\r?\n[^\n]*\n\s*)*0\s+SECTION|II\*\0|MM\0\*|RIFF.{4}WEBP": (
        "a drawing or a picture", f"save it as a PNG; {_WORLDS}"),
    r"version https://git-lfs": ("a pointer of Git LFS", "get the file itself with 'git lfs pull'"),
    r"# \.PCD v|#usda \d|PXR-USDC|solid [^\n]*\s+facet normal|ply\r?\nformat |#ROSBAG V|\x89MCAP|SQLite format 3": (
        "a mesh, a point cloud or a recording", f"save its plan or its map as a PNG; {_WORLDS}"),
    r"(?!\xff\xfe|\xfe\xff).{0,900}?(?:\0{4}|(?:[^\0]\0){4})": ("a binary file", _WORLDS),
}  # fmt: skip
"""What a file begins with, what it is, and what to do. No file of zteam's begins like this."""
_CONTENTS = {
    r"\A<(?i:html|!DOCTYPE html)\b": ("a web page", "download the file itself (on GitHub: Raw)"),
    r"\A<robot\b": ("a robot's description (URDF)", "name it as the description of a robot in a team file"),
    r"\A<launch\b|^def generate_launch_description\b": ("a launch file of ROS", "write a team file instead"),
    r"\A<(?:sdf|gazebo)\b": ("a file of Gazebo (SDF)", _WORLDS),
    r"\A<\w": ("an XML file (MVSim, Tiled, SVG and others)", f"export its plan as a PNG; {_WORLDS}"),
    TEAM_FILE: ("a team file", "name it *.toml, and say 'zteam up FILE.toml'"),
    MAP_FILE: ("a map of map_server", "a team file takes it, named *.yaml, as its world or its map"),
    r'\A(?:from [\w.]+ import|import [\w.]+|""")': ("a Python program", "name it as a behavior or a node of a team"),
    r"^WorldInfo\s*\{": ("a file of Webots (VRML)", _WORLDS),
    r"^[ \t]*driver\s*\([^)]{0,500}\b(?:provides|plugin)\b": ("a configuration of Player", "name its worldfile"),
    r"^world:[ \t]*(?:[#{][^\n]*)?\r?$": ("a world of IR-SIM", _WORLDS),
    r"^layers:": ("a world of flatland", "name the map of one of its layers: a YAML file with image and resolution"),
    YAML_FILE: ("a YAML or JSON file", f"{_WORLDS}; a team file is TOML"),
    r"\A(?:PARAM|FLASER|ODOM) ": ("a log of CARMEN", _WORLDS),
}  # fmt: skip
"""The same for what a file contains after the comments at its beginning. The first row that matches holds. A valid file
may contain this too, such as a program as a text of a team file, so only what its own reader refuses is looked at."""
_COMMENTS = re.compile(r"(?is)\A(?:\s|#[^\n]*|<\?[^>]*>|<!--.*?-->|<!DOCTYPE (?!html)[^\[>]*(?:\[.*?\]\s*)?>)+")


def refuse_head(path: Path, data: bytes, wanted: str, error: type[UsageError]) -> None:
    """Raise `error` if a file begins as one of another program, and so is not a `wanted`."""
    head = data[:1000].removeprefix(codecs.BOM_UTF8).decode("latin-1")
    _refuse(path, _HEADS, next((key for key in _HEADS if re.match(key, head, re.DOTALL)), ""), wanted, error)


@contextmanager
def name_foreign(path: Path, wanted: str, *own: str) -> Iterator[None]:
    """What the body refuses is refused as a file of another program if it is one. Rows of `own` are not."""
    try:
        yield
    except UsageError as error:
        with suppress(OSError, ValueError), path.open("rb") as file:
            text = _COMMENTS.sub("", decode_text(file.read(65_536)))
            key = next((key for key in _CONTENTS if re.search(key, text, re.DOTALL | re.MULTILINE)), "")
            _refuse(path, _CONTENTS, "" if key in own else key, wanted, type(error))
        raise


def _refuse(path: Path, rows: dict[str, tuple[str, str]], key: str, wanted: str, error: type[UsageError]) -> None:
    if key:
        what, way_out = rows[key]
        raise error(f"{path}: this is {what}, not a {wanted}: {way_out.format(path)}") from None


def decode_text(data: bytes) -> str:
    """A file's text in UTF-16 or UTF-8; what is no text in its encoding becomes U+FFFD."""
    is_wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if is_wide else "utf-8-sig", "replace")
