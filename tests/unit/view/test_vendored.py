"""What the page carries of others is what its authors published, with its licence."""

import hashlib
from pathlib import Path

import zteam

VENDOR = Path(zteam.__file__).parent / "view/page/vendor"

PUBLISHED = {
    "uplot/LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
    "uplot/uPlot.esm.d.ts": "af44374f6e808be4f7f3fa5888b9c7574dca9f8a15a66d54b6763535802c8080",
    "uplot/uPlot.esm.js": "5dd9b3281aa64b461b42d9945f6adb2649d346502b12281a9ae0d46599a80eba",
    "uplot/uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}
"""SHA-256 of LICENSE and of the files in `dist/` of the npm package uplot 1.6.32 (`uPlot.d.ts` under another name, so
that it is found beside the module)."""


def test_vendored_files_are_unchanged() -> None:
    """Each vendored file has the bytes that its authors published, and none is carried without its hash."""
    files = {path.relative_to(VENDOR).as_posix(): path for path in VENDOR.rglob("*") if path.is_file()}
    assert {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()} == PUBLISHED
