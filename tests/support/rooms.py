"""The picture of the package's layers, of the contract in pyproject.toml: `python tests/support/rooms.py` draws it."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "rooms.svg"
WIDTH, HEIGHT, GAP, LEFT = 720, 30, 8, 40
"""Pixels: of a row, of a box, between boxes, and left of them."""


def layers() -> list[list[str]]:
    """The rooms of each layer, the highest first: a room imports only those below it."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (rows,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [[room.strip().removeprefix("zteam.") for room in row.split("|")] for row in rows]


def draw() -> str:
    """The picture: one row a layer."""
    rows = layers()
    height = len(rows) * (HEIGHT + GAP) + GAP
    size = f'viewBox="0 0 {WIDTH + LEFT + GAP} {height}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="13" text-anchor="middle">',
        f'<path d="M18 {GAP} V{height - GAP} m-5 -9 l5 9 l5 -9" fill="none" stroke="#57606a" stroke-width="2"/>',
    ]
    for number, row in enumerate(rows):
        width = (WIDTH - GAP * (len(row) - 1)) / len(row)
        y = GAP + number * (HEIGHT + GAP)
        for place, room in enumerate(row):
            x = LEFT + place * (width + GAP)
            box = f'x="{x:.0f}" y="{y}" width="{width:.0f}" height="{HEIGHT}" rx="4" fill="#ddf4ff" stroke="#54aeff"'
            parts.append(f'<rect {box}/><text x="{x + width / 2:.0f}" y="{y + 20}">{room}</text>')
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(draw())
