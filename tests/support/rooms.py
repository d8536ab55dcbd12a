"""The picture of the package's rooms, of the contracts in pyproject.toml: `python tests/support/rooms.py` draws it."""

import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "rooms.svg"
WIDTH, HEIGHT, GAP, LEFT = 720, 46, 8, 40
"""Pixels: of a row, of a box, between boxes, and left of them."""


def contracts() -> list[dict[str, Any]]:
    """The contracts of import-linter."""
    tools: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    return list(tools["importlinter"]["contracts"])


def layers() -> list[list[str]]:
    """The rooms of each layer, the highest first: a room imports only those below it."""
    (rows,) = (contract["layers"] for contract in contracts() if contract["type"] == "layers")
    return [[room.strip().removeprefix("zteam.") for room in row.split("|")] for row in rows]


def parts() -> dict[str, list[str]]:
    """What is in each room: its packages, and modules that the contracts name, as `world` of `simulator`."""
    lists = [value for contract in contracts() for value in contract.values() if isinstance(value, list)]
    named = {name for names in lists for name in names}
    named |= {".".join(file.parent.relative_to(ROOT).parts) for file in ROOT.glob("zteam/*/*/__init__.py")}
    words = [name.split(".") for name in sorted(named) if name.startswith("zteam.") and " " not in name]
    return {room: [word[2] for word in words if len(word) == 3 and word[1] == room] for _, room, *_ in words}


def pure() -> set[str]:
    """The packages without a bus, as `simulator.world`."""
    (names,) = (contract["source_modules"] for contract in contracts() if contract["name"] == "Pure cores know no bus")
    return {name.removeprefix("zteam.") for name in names}


def draw() -> str:
    """The picture: one row a layer; single modules white; below a room's name its parts, the pure ones in green."""
    rows, inside, without_bus = layers(), parts(), pure()
    height = len(rows) * (HEIGHT + GAP) + GAP
    size = f'viewBox="0 0 {WIDTH + LEFT + GAP} {height}"'
    drawn = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="13" text-anchor="middle">',
        f'<path d="M18 {GAP} V{height - GAP} m-5 -9 l5 9 l5 -9" fill="none" stroke="#57606a" stroke-width="2"/>',
    ]
    for number, row in enumerate(rows):
        width = (WIDTH - GAP * (len(row) - 1)) / len(row)
        y = GAP + number * (HEIGHT + GAP)
        for place, room in enumerate(row):
            x = LEFT + place * (width + GAP)
            fill = "#ddf4ff" if (ROOT / "zteam" / room).is_dir() else "#ffffff"
            box = f'x="{x:.0f}" y="{y}" width="{width:.0f}" height="{HEIGHT}" rx="4" fill="{fill}" stroke="#54aeff"'
            found = [
                f'<tspan fill="{"#1a7f37" if f"{room}.{part}" in without_bus else "#57606a"}">{part}</tspan>'
                for part in inside.get(room, [])
            ]
            middle, color = x + width / 2, ' fill="#1a7f37"' if room in without_bus else ""
            drawn.append(f'<rect {box}/><text x="{middle:.0f}" y="{y + (19 if found else 28)}"{color}>{room}</text>')
            if found:
                drawn.append(f'<text x="{middle:.0f}" y="{y + 37}" font-size="11">{" · ".join(found)}</text>')
    return "\n".join([*drawn, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(draw())
