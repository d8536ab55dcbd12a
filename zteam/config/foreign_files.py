"""Files of other programs, known by what is in them, and told as such where a world, a map or a team is read."""

import codecs
import re
from pathlib import Path

from zteam.errors import UsageError

_WORLDS = "zteam reads worlds of Stage and maps of map_server; of a plan, 'zteam world new PLAN.png' makes a world"
MAP_FILE = r"\A(?=.*^image:)(?=.*^resolution:)"
_KINDS = {
    r"\A(?:\x89PNG|P[1-6]\s|\xff\xd8\xff|GIF8|BM.{4}\0{4})": (
        "a picture", "'zteam world new {} --resolution METRES' makes a world of it"),
    r"\A(?:PK\x03\x04|\x1f\x8b|BZh\d|7z\xbc\xaf|\xfd7zXZ|\x28\xb5\x2f\xfd|Rar!|.{257}ustar)": (
        "a packed file", "unpack it, and name the file that was in it"),
    r"\A(?:%PDF|<svg\b|AC10\d\d|0\s+SECTION|II\*\0|MM\0\*|RIFF.{4}WEBP)": (
        "a drawing or a picture", f"save it as a PNG; {_WORLDS}"),
    r"\Aversion https://git-lfs": ("a pointer of Git LFS", "get the file itself with 'git lfs pull'"),
    r"\A<(?i:html)\b": ("a web page", "download the file itself (on GitHub: Raw)"),
    r"\A<robot\b": ("a robot's description (URDF)", "name it as the description of a robot in a team file"),
    r"\A<launch\b|\bgenerate_launch_description\b": ("a launch file of ROS", "write a team file instead"),
    r"^(?:from [\w.]+ import|import [\w.]+)": ("a Python program", "name it in a team file, as a behavior or a node"),
    r"\A<(?:sdf|gazebo)\b": ("a file of Gazebo (SDF)", _WORLDS),
    r"\A<\w": ("an XML file (MVSim, Tiled and others)", f"export its plan as a PNG; {_WORLDS}"),
    r"\A#(?:VRML|X3D)|^WorldInfo\s*\{": ("a file of Webots (VRML)", _WORLDS),
    r"^[ \t]*driver\s*\([^)]{0,500}\b(?:provides|plugin)\b": ("a configuration of Player", "name its worldfile"),
    MAP_FILE: ("a map of map_server", "a team file takes it, named *.yaml, as its world or its map"),
    r"^world:[ \t]*(?:[#{][^\n]*)?\r?$": ("a world of IR-SIM", _WORLDS),
    r"^layers:": ("a world of flatland", "name the map of one of its layers: a YAML file with image and resolution"),
    r'\A\{(?=\s*")(?!.*"image")': ("JSON", _WORLDS),
    r"\0{4}|(?:[^\0]\0){4}": ("a binary file", _WORLDS),
}  # fmt: skip
"""What the first 64 kB of a file match, what the file is, and what to do. The first row that matches holds."""


def refuse_foreign(path: Path, data: bytes, wanted: str, error: type[UsageError], own: str) -> None:
    """Raise `error` if these bytes of a file are of another program and not a `wanted`, which matches `own`."""
    head, blanks = data[:65_536], " \t\r\n"
    is_wide = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = head.decode("utf-16", "replace") if is_wide else head.removeprefix(codecs.BOM_UTF8).decode("latin-1")
    text = text.lstrip(blanks)
    while text.startswith(("<?", "<!")):  # what stands before the first element of XML
        text = text.partition("-->" if text.startswith("<!--") else ">")[2].lstrip(blanks)
    pattern = next((pattern for pattern in _KINDS if re.search(pattern, text, re.DOTALL | re.MULTILINE)), own)
    if pattern != own:
        what, way_out = _KINDS[pattern]
        raise error(f"{path}: this is {what}, not a {wanted}: {way_out.format(path)}")
