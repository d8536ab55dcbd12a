"""The documents keep their word: examples run, and the reference names what the parser knows."""

import re
from pathlib import Path
from typing import Any

import pytest

from zteam.world import vocabulary
from zteam.world.devices import device_models

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_notebook_example_runs() -> None:
    """The code of the simulator's page works as it stands there."""
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / "simulator.md").read_text(), re.DOTALL)
    scope: dict[str, Any] = {}
    exec(code, scope)
    assert scope["robot"].truth.x == pytest.approx(15.0)
    assert sorted(scope["engine"].robots) == [0, 2, 3, 7]


def test_every_property_is_in_the_reference() -> None:
    """All names that the parser reads, passes over or remarks stand in the tables, and every model type."""
    text = re.sub(r"```.*?```", "", (DOCS / "world-files.md").read_text(), flags=re.DOTALL)
    named = set(re.findall(r"[a-z_]+", " ".join(re.findall(r"`([^`]+)`", text))))
    known = set().union(
        *vocabulary.READ.values(),
        *vocabulary.SILENT.values(),
        vocabulary.REMARKED,
        vocabulary.TYPES,
        device_models(),
        *(model.properties for model in device_models().values()),
        vocabulary._DISPLAY,
    )
    missing = {name.removesuffix("[]") for name in known} - named
    assert not missing
