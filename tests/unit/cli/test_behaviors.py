"""`zteam behaviors`: what there is, and what one takes."""

import json
import sys
from pathlib import Path

import pytest

from support.commands import Run
from support.installed_packages import install
from zteam.cli.behaviors import limits_text, value_text
from zteam.robot.behaviors.registry import BEHAVIORS

MINE = '''
from typing import Annotated
import msgspec
from zteam.behaviors import Behavior

class Spin(Behavior):
    """Turn on the spot,
    for ever.

    More of it.
    """
    class Params(msgspec.Struct, forbid_unknown_fields=True):
        rate: Annotated[float, msgspec.Meta(gt=0.0, description="rad/s")]
        label: str | None = None

    def step(self, view): ...

class Bare(Behavior):
    def step(self, view): ...
'''


@pytest.fixture
def folder(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user stands beside a module with two behaviours."""
    (empty_folder / "my_spinner.py").write_text(MINE)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    return empty_folder


def test_the_list_has_one_line_for_each(folder: Path, run: Run) -> None:
    """Shipped behaviours, then those of installed packages; one that cannot be imported is named after the list."""
    points = "[zteam.behaviors]\nacme_spin = my_spinner:Spin\nacme_gone = my_spinner:Gone\n"
    install(folder, "acme-robots", points, {})
    out, err = run("zteam behaviors", 2)
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[1 : 1 + len(BEHAVIORS)]] == list(BEHAVIORS)
    assert lines[2] == "forward    The same speed for ever; only the safety layer stops it."
    assert lines[1 + len(BEHAVIORS)] == "acme_spin  Turn on the spot, for ever."
    (line,) = err.splitlines()
    assert line.startswith("zteam behaviors: 'acme_gone' of the entry points zteam.behaviors: cannot import ")


def test_a_behaviour_of_ones_own_is_shown(folder: Path, run: Run) -> None:
    """The first paragraph of its docstring, and its parameters with default, type, limits and description."""
    assert run(f"zteam behaviors my_spinner:Spin --path {folder}").out.splitlines() == [
        "my_spinner:Spin: Turn on the spot, for ever.",
        "class my_spinner:Spin",
        "",
        "  parameter  default   type        allowed  description",
        "  rate       required  float       above 0  rad/s",
        "  label      none      str | None",
    ]
    assert run("zteam behaviors my_spinner:Bare").out.splitlines()[::3] == [
        "my_spinner:Bare: its class has no docstring",
        "  no parameters",
    ]


def test_scripts_get_json(run: Run) -> None:
    """The list, and one behaviour of it."""
    follow = json.loads(run("zteam behaviors follow --json").out)
    assert follow in json.loads(run("zteam behaviors --json").out)
    assert follow["source"] == "zteam.robot.behaviors.follow:Follow"
    description = {"description": "id of the robot to follow", "required": True, "default": None}
    assert follow["parameters"][0] == {"name": "leader", "type": "int", "limits": {"ge": 0, "le": 9999}, **description}


def test_limits_and_values_are_words() -> None:
    """A range where both ends are known, else each limit in words; a number has no noise digits, a text its quotes."""
    assert limits_text({"ge": 0.0, "le": 3.141592653589793}) == "0 to 3.14159"
    assert limits_text({"gt": 0, "lt": 5}) == "above 0, below 5"
    assert limits_text({"ge": 0.0, "lt": 5.0}) == "at least 0, below 5"
    assert limits_text({"min_length": 1, "max_length": 9, "pattern": "[a-z]+"}) == (
        'at least 1 long, at most 9 long, like "[a-z]+"'
    )
    values = (1.0471975511965976, 2, True, "a b", None, [1.0, 2])
    assert [value_text(value) for value in values] == ["1.0472", "2", "true", '"a b"', "none", "[1.0, 2]"]
