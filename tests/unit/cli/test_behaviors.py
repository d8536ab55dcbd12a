"""`zteam behaviors`: what there is, and what one takes."""

import json
import sys
from pathlib import Path

import pytest

from support.installed_packages import install
from zteam.cli import main as zteam
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
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a module of the user's, forgotten afterwards."""
    (tmp_path / "my_spinner.py").write_text(MINE)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    return tmp_path


def test_the_list_has_one_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    """Every shipped behaviour, with what it does."""
    assert zteam.main(["behaviors"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1 : 1 + len(BEHAVIORS)]] == list(BEHAVIORS)
    assert lines[2] == "forward    The same speed for ever; only the safety layer stops it."


def test_a_behaviour_of_ones_own_is_shown(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first paragraph of its docstring, and its parameters with default, type, limits and description."""
    assert zteam.main(["behaviors", "my_spinner:Spin", "--path", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "my_spinner:Spin: Turn on the spot, for ever.",
        "class my_spinner:Spin",
        "",
        "  parameter  default   type        allowed  description",
        "  rate       required  float       above 0  rad/s",
        "  label      none      str | None",
    ]
    assert zteam.main(["behaviors", "my_spinner:Bare"]) == 0
    assert capsys.readouterr().out.splitlines()[::3] == [
        "my_spinner:Bare: its class has no docstring",
        "  no parameters",
    ]


def test_scripts_get_json(capsys: pytest.CaptureFixture[str]) -> None:
    """The list, and one behaviour of it."""
    assert zteam.main(["behaviors", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert zteam.main(["behaviors", "follow", "--json"]) == 0
    follow = json.loads(capsys.readouterr().out)
    assert follow in listed
    assert follow["source"] == "zteam.robot.behaviors.follow:Follow"
    assert follow["parameters"][0] == {
        "name": "leader",
        "type": "int",
        "limits": {"ge": 0, "le": 9999},
        "description": "id of the robot to follow",
        "required": True,
        "default": None,
    }


def test_offers_of_installed_packages_are_listed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They come after the shipped ones; one that cannot be imported is named after the list, with exit code 2."""
    sys.path.append(str(folder))
    points = "[zteam.behaviors]\nacme_spin = my_spinner:Spin\nacme_gone = my_spinner:Gone\n"
    install(folder, "acme-robots", points, {})
    assert zteam.main(["behaviors"]) == 2
    out, errors = capsys.readouterr()
    assert out.splitlines()[1 + len(BEHAVIORS)] == "acme_spin  Turn on the spot, for ever."
    assert errors.startswith("zteam behaviors: 'acme_gone' of the entry points zteam.behaviors: cannot import ")
    assert len(errors.splitlines()) == 1


def test_an_unknown_name_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    """One line, exit code 2."""
    assert zteam.main(["behaviors", "wandr"]) == 2
    assert "no behaviour 'wandr' (did you mean wander?)" in capsys.readouterr().err
