"""The page on behaviours is held to the code: the fields of a view, the shipped behaviours, and its example."""

import math
import re
from pathlib import Path
from typing import Any

import pytest

from zteam.behaviors import View
from zteam.cli.behaviors import format_behavior, limits_text, value_text
from zteam.robot.behaviors.registry import BEHAVIORS, describe_behavior
from zteam.testing import make_view

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "behaviors.md").read_text()


def section(heading: str) -> str:
    """The text below a heading, up to the next one of any level."""
    return re.split(r"^##+ ", PAGE.split(f"# {heading}\n", 1)[1], maxsplit=1, flags=re.MULTILINE)[0].strip()


def test_the_page_lists_what_a_view_has() -> None:
    """Every public field and method of `View` has its row, and no row names anything else."""
    rows = re.findall(r"^\| `(\w+)[^|]*` \|", section("What a behaviour sees"), re.MULTILINE)
    public = {name for name in dir(View) if not name.startswith("_")}
    assert set(rows) == public
    assert len(rows) == len(public)


@pytest.mark.parametrize("name", BEHAVIORS)
def test_the_page_tells_what_a_shipped_behaviour_does_and_takes(name: str) -> None:
    """Its section begins with its docstring and a table of its parameters, as the code has them."""
    info = describe_behavior(name)
    cells = [
        (
            f"`{each.name}`",
            "required" if each.required else value_text(each.default),
            each.type,
            limits_text(each.limits),
            each.description,
        )
        for each in info.parameters
    ]
    rows = ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in cells]
    head = ["| parameter | default | type | allowed | description |", "| --- | --- | --- | --- | --- |"]
    told = [info.summary, "", *([*head, *rows] if rows else ["It takes no parameters."]), ""]
    assert f"{section(f'`{name}`')}\n".split("\n")[: len(told)] == told


def test_the_page_shows_no_other_behaviour() -> None:
    """The shipped ones have a section each."""
    assert re.findall(r"^### `(\w+)`$", PAGE, re.MULTILINE) == list(BEHAVIORS)


def test_the_example_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It drives and turns, takes new parameters, and is described as the page shows."""
    text = section("Your own")
    code, shown = re.findall(r"```(?:python|text)\n(.*?)```", text, re.DOTALL)
    (tmp_path / "patrol.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    assert format_behavior(describe_behavior("patrol:Patrol")) == shown.rstrip("\n")
    scope: dict[str, Any] = {}
    exec(code, scope)
    patrol = scope["Patrol"](scope["Patrol"].Params(leg=0.25))
    commands = [patrol.step(make_view([5.0] * 9, dt=0.1)) for _ in range(4)]
    assert [command.linear.x for command in commands] == [0.3, 0.3, 0.0, 0.0]
    assert commands[2].angular.z == 1.0
    turned = [patrol.step(make_view([5.0] * 9, dt=0.1)).linear.x for _ in range(math.ceil(10 * math.pi))]
    assert turned[-1] == 0.3
    patrol.params = scope["Patrol"].Params(leg=0.05, speed=0.1)
    patrol.on_params()
    assert patrol.step(make_view([5.0] * 9, dt=0.1)).angular.z == 1.0
