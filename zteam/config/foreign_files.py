"""Files of other programs, known by what is in them, and told as such where a world, a map or a team is asked for."""

import codecs
import re
from pathlib import Path

from zteam.errors import UsageError

_WORLDS = "zteam reads worlds of Stage and maps of map_server; of a plan, 'zteam world new PLAN.png' makes a world"
PICTURE_FILE = r"\A(?:\x89PNG|P[1-6]\s|\xff\xd8\xff|GIF8|BM.{4}\0{4}|II\*\0|MM\0\*|RIFF.{4}WEBP)"
MAP_FILE = r"\A(?=.*^image:)(?=.*^resolution:)"
_KINDS = {
    PICTURE_FILE: ("a picture", "'zteam world new {} --resolution METRES' makes a world of it"),
    r"\A(?:PK\x03\x04|\x1f\x8b|BZh\d|7z\xbc\xaf|\xfd7zXZ|\x28\xb5\x2f\xfd|Rar!|.{257}ustar)": (
        "a packed file", "unpack it, and name the file that was in it"),
    r"\A(?:%PDF|<svg\b|AC10\d\d|0\s+SECTION)": ("a drawing", f"save it as a PNG; {_WORLDS}"),
    r"\Aversion https://git-lfs": ("a pointer of Git LFS", "get the file itself with 'git lfs pull'"),
    r"\A<html\b": ("a web page", "download the file itself (on GitHub: Raw)"),
    r"\A<(?:sdf|gazebo)\b": ("a file of Gazebo (SDF)", _WORLDS),
    r"\A<mvsim": ("a world of MVSim", _WORLDS),
    r"\A<robot\b": ("a robot's description (URDF)", "name it as the description of a robot in a team file"),
    r"\A<launch\b|\bgenerate_launch_description\b": ("a launch file of ROS", "write a team file instead"),
    r"^(?:from [\w.]+ import|import [\w.]+)": ("a Python program", "name it in a team file, as a behavior or a node"),
    r"\A<map\b": ("a map of Tiled", f"export it as a PNG; {_WORLDS}"),
    r"\A<\w": ("an XML file", _WORLDS),
    r"\A#(?:VRML|X3D)|^WorldInfo\s*\{": ("a file of Webots (VRML)", _WORLDS),
    r"^[ \t]*driver\s*\([^)]{0,500}\b(?:provides|plugin)\b": (
        "a configuration of Player", "name the world that it has as its worldfile"),
    MAP_FILE: ("a map of map_server", "call it *.yaml; a team file takes it as its world or its map"),
    r"^world:[ \t]*\r?\n": ("a world of IR-SIM", _WORLDS),
    r"^layers:": ("a world of flatland", "name the map of one of its layers: a YAML file with image and resolution"),
    r'\A\{(?=\s*")(?!.*"image")': ("JSON", _WORLDS),
    r"\0{4}|(?:[^\0]\0){4}": ("a binary file", _WORLDS),
}  # fmt: skip
"""What the first 64 kB of a file match, what the file is, and what to do. The first row that matches holds."""


def refuse_foreign(path: Path, wanted: str, error: type[UsageError], own: str = "") -> None:
    """Raise `error` if this is a file of another program and not what is `wanted`, which may be of the kind `own`.

    A file that cannot be read is none; nor is a pipe, which can be read only once.
    """
    try:
        if not path.is_file():
            return
        with path.open("rb") as file:
            head = file.read(65_536)
    except (OSError, ValueError):
        return
    blanks, is_wide = " \t\r\n", head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = head.decode("utf-16", "replace") if is_wide else head.removeprefix(codecs.BOM_UTF8).decode("latin-1")
    text = text.lstrip(blanks)
    while text.startswith(("<?", "<!")):  # what stands before the first element of XML
        text = text.partition("-->" if text.startswith("<!--") else ">")[2].lstrip(blanks)
    for pattern, (what, way_out) in _KINDS.items():
        if re.search(pattern, text, re.DOTALL | re.MULTILINE):
            if pattern != own:
                raise error(f"{path}: this is {what}, not {wanted}: {way_out.format(path)}")
            return
