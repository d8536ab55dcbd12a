"""The short cuts that the page lists are those in its description."""

import re
from pathlib import Path

import zteam
from support.pages import DOCS

SCRIPTS = Path(zteam.__file__).parent / "view/page/js"
ROW = re.compile(r'\{ keys: "([^"]+)", text: "([^"]+)", group: "([^"]+)" \}')


def test_all_short_cuts_are_described() -> None:
    """docs/view.md has a row for each short cut of the map and of the panels, and no other row."""
    scripts = [SCRIPTS / name for name in ("shortcuts.js", "panels/keys.js")]
    listed = [
        f"| {group} | `{keys}` | {text} |" for path in scripts for keys, text, group in ROW.findall(path.read_text())
    ]
    section = (DOCS / "view.md").read_text().split("## Shortcuts\n")[1].split("\n## ")[0]
    described = [line for line in section.splitlines() if line.startswith("|")][2:]
    assert len(listed) > 20
    assert described == listed
