"""Arguments of team files: which texts stand for them, where their values come from, and what is wrong with them."""

from pathlib import Path

import pytest

from zteam.errors import ConfigError, UsageError
from zteam.team.file.entries import Team
from zteam.team.file.reading import load_team, read_team_file
from zteam.team.file.sources import argument_texts, describe_arguments, parse_arguments

ROBOTS = "[[robots]]\nid = 0\n"


def load(folder: Path, text: str, *words: str) -> Team:
    """The team in a file of this text, with the arguments of a command line."""
    path = folder / "team.toml"
    path.write_text(text, encoding="utf-8")
    return load_team(path, parse_arguments(words))


def places_of(folder: Path, text: str, *words: str) -> list[str]:
    """Where the mistakes stand in a file of this text."""
    with pytest.raises(ConfigError) as caught:
        load(folder, text, *words)
    lines = str(caught.value).replace(f"{folder}/team.toml:", "").splitlines()
    return [": ".join(line.split(": ")[:2]) for line in lines]


@pytest.mark.parametrize(
    ("text", "words", "value"),
    [
        ('"${x:-0}"', [], 0),
        ('"${x:-0}"', ["x=2"], 2),
        ('"${x:-0.5}"', [], 0.5),
        ('"${x:-near}"', [], "near"),
        ("'${x:-\"2\"}'", [], "2"),
        ('"${x:-}"', [], ""),
        ('"${x}"', ["x="], ""),
        ('"${x}"', ["x=a=b"], "a=b"),
        ('"${x:-[1, 2]}"', [], [1, 2]),
        ('"${x:-{a = 1}}"', [], {"a": 1}),
        ('["${x:-1}", {y = "${x:-2}"}]', [], [1, {"y": 2}]),
        ('"${x:-{a = {b = 1}}}"', [], {"a": {"b": 1}}),
        # In a longer text: the text of each.
        ('"--count=${n:-3}"', [], "--count=3"),
        ('"--count=${n:-3}"', ["n=0.50"], "--count=0.50"),
        ('"1-${last:-3}"', ["last=7"], "1-7"),
        ('"${x:-0}${y:-1} ${x:-2}"', ["x=5"], "51 5"),
        ("'a ${x:-\"2\"}'", [], "a 2"),
        ('"a ${x:-}b"', [], "a b"),
        ('"a ${x:-true} ${y:-[1, 2]}"', [], "a true [1, 2]"),
        ('"${x:-1}-{y}"', [], "1-{y}"),
        ("'${x:-\"{\"}'", [], "{"),
        ("'${x:-{a = [\"}\"]}}'", [], {"a": ["}"]}),
        ('\'a ${x:-"}"} ${y:-"\\"{"}\'', [], 'a } "{'),
        ("'${x:-5\"} ${y:-6\"}'", [], '5" 6"'),
        ("'{\"n\": ${n:-3}}'", [], '{"n": 3}'),
        ('["a", "b ${x:-1}", {y = "c${x:-1}"}]', ["x=d"], ["a", "b d", {"y": "cd"}]),
        # A shell's own.
        ('"$${x}"', [], "${x}"),
        ('"echo $${x:-0} ${y:-1}"', [], "echo ${x:-0} 1"),
        # No reference: the text itself.
        ('"${1x:-0}"', [], "${1x:-0}"),
        ('"a $x $ {x} ${} $$"', [], "a $x $ {x} ${} $$"),
        # What is given is not looked through once more.
        ('"${x:-0}"', ["x=${x:-0}"], "${x:-0}"),
        ('"a ${x:-0}"', ["x=${x:-0}"], "a ${x:-0}"),
    ],
)
def test_a_reference_stands_for_a_value(tmp_path: Path, text: str, words: list[str], value: object) -> None:
    """A whole text for one of TOML, or a text without quotes; in a longer text for the text of that."""
    assert load(tmp_path, f"{ROBOTS}p = {text}\n", *words).robots[0].params == {"p": value}


def test_a_missing_argument_is_told_once_at_each_place(tmp_path: Path) -> None:
    """Nothing else is told, because other values may follow from it."""
    text = '[team]\nworld = "${map}"\nseed = -1\n[[robots]]\nid = "${id}"\n[[robots]]\nid = 1\nfollow = "1${id}"\n'
    assert places_of(tmp_path, text) == ["2: team.world", "5: robots[0].id", "8: robots[1].follow"]


def test_a_group_takes_a_part_of_its_ids(tmp_path: Path) -> None:
    """As a node takes a part of an argument of its command."""
    text = '[[robots]]\nids = "1-${last:-3}"\n[[nodes]]\nname = "n"\ncommand = ["python", "--count=${n:-3}"]\n'
    assert [robot.id for robot in load(tmp_path, text).robots] == [1, 2, 3]
    team = load(tmp_path, text, "last=2", "n=4")
    assert ([robot.id for robot in team.robots], team.nodes[0].command[1]) == ([1, 2], "--count=4")


def test_mistakes_in_arguments_are_one_line(tmp_path: Path) -> None:
    """One that the file does not take, and a value of the wrong type, as if it stood in the file."""
    text = '[[robots]]\nid = "${id:-0}"\n'
    assert len(places_of(tmp_path, text, "x=2")) == 1
    assert places_of(tmp_path, text, "id=first") == ["2: robots[0].id"]


@pytest.mark.parametrize("words", [["leader"], ["=2"], ["a b=2"], ["x=1", "x=2"]])
def test_words_that_are_no_arguments_are_refused(words: list[str]) -> None:
    """A name, the equals sign, and each name once."""
    with pytest.raises(UsageError):
        parse_arguments(words)


def test_arguments_of_a_program_are_values(tmp_path: Path) -> None:
    """A text stays a text, even if it looks like a number; what TOML lacks is refused."""
    path = tmp_path / "team.toml"
    path.write_text(f'{ROBOTS}p = "${{p}}"\nq = "${{q}}"\n')
    team = load_team(path, argument_texts({"p": "2", "q": [1.5, True]}))
    assert team.robots[0].params == {"p": "2", "q": [1.5, True]}
    with pytest.raises(UsageError):
        argument_texts({"p": None})


def test_a_file_tells_what_it_takes(tmp_path: Path) -> None:
    """Name, default and place; another default of the same name has a row of its own."""
    path = tmp_path / "team.toml"
    path.write_text(f'{ROBOTS}a = "${{a}}"\nb = "${{b:-1}}"\nc = "${{b:-2}}"\nd = "${{b:-1}}"\n')
    assert describe_arguments(read_team_file(path).arguments) == [
        ("a", "", f"{path}:3"),
        ("b", "1", f"{path}:4"),
        ("b", "2", f"{path}:5"),
    ]
