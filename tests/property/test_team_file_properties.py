"""Team files of many kinds: arguments stand for the values that they have, and includes for the tables in them."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.config.problems import Problem
from zteam.config.toml_values import toml_text
from zteam.team.file.reading import load_team, read_team_file
from zteam.team.file.sources import argument_texts

names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}", fullmatch=True)
scalars = (
    st.booleans()
    | st.integers(-(2**63) + 1, 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)
)
values = st.recursive(scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3))
"""Every value that a parameter can have."""


def write(folder: Path, name: str, text: str) -> Path:
    """A file of this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@given(st.dictionaries(names, values, min_size=1, max_size=4))
def test_an_argument_is_the_value_itself(
    tmp_path_factory: pytest.TempPathFactory, given_values: dict[str, Any]
) -> None:
    """A file with references and their values as arguments is the file with the values, however they are nested."""
    folder = tmp_path_factory.getbasetemp()
    references = "".join(f'p_{name} = ["${{{name}}}"]\n' for name in given_values)
    path = write(folder, "filled.toml", f"[[robots]]\nid = 0\n{references}")
    params = load_team(path, argument_texts(given_values)).robots[0].params
    assert params == {f"p_{name}": [value] for name, value in given_values.items()}


@given(values)
def test_a_default_holds_until_the_argument_is_given(tmp_path_factory: pytest.TempPathFactory, value: Any) -> None:
    """The default in the file reads as the argument would; a given value replaces it."""
    text = toml_text(value)
    reference = "${a:-" + text + "}"
    if "${" in text:
        # Not one reference, but a text with two.
        return
    path = write(tmp_path_factory.getbasetemp(), "default.toml", f"[[robots]]\nid = 0\np = {toml_text(reference)}\n")
    assert load_team(path).robots[0].params == {"p": value}
    assert load_team(path, {"a": "other"}).robots[0].params == {"p": "other"}


def section(keys: list[str], number: int) -> dict[str, Any]:
    """A [team] table with these keys, whose values tell the file `number`."""
    all_keys = {"seed": number, "world": f"w{number}", "world_robots": number % 2 == 0}
    return {key: all_keys[key] for key in keys}


files = st.lists(
    st.tuples(
        st.lists(st.sampled_from(["seed", "world", "world_robots"]), unique=True),
        st.lists(st.integers(0, 9), unique=True, max_size=3),
    ),
    min_size=1,
    max_size=4,
)


@given(files, st.booleans())
def test_included_files_merge_in_order(
    tmp_path_factory: pytest.TempPathFactory, made: list[tuple[list[str], list[int]]], nested: bool
) -> None:
    """In a row or each in the next: the last file that has a key of a table wins, robots follow each other, and each
    repeated id is one problem at the later table."""
    folder = tmp_path_factory.getbasetemp()
    for number, (keys, robots) in enumerate(made):
        table = "".join(f"{key} = {toml_text(value)}\n" for key, value in section(keys, number).items())
        include = f'include = ["f{number - 1}.toml"]\n' if nested and number else ""
        entries = "".join(f"[[robots]]\nid = {robot_id}\n" for robot_id in robots)
        write(folder, f"f{number}.toml", f"{include}[team]\n{table}{entries}")
    listed = [f"f{len(made) - 1}.toml"] if nested else [f"f{number}.toml" for number in range(len(made))]
    file = read_team_file(write(folder, "all.toml", f"include = {toml_text(listed)}\n"))

    wanted: dict[str, Any] = {}
    for number, (keys, _) in enumerate(made):
        wanted |= section(keys, number)
    assert {key: getattr(file.team.team, key) for key in wanted} == wanted
    in_order = [robot_id for _, robots in made for robot_id in robots]
    assert [robot.id for robot in file.team.robots] == in_order
    repeated = [robot_id for at, robot_id in enumerate(in_order) if robot_id in in_order[:at]]
    told = [mistake.text for mistake in file.mistakes if mistake.place.path[-1:] == ("id",)]
    assert [text.split()[1] for text in told] == [str(robot_id) for robot_id in repeated]
    assert all(
        str(file.table.locate([Problem(("robots", at), "")])[0]).startswith(str(folder)) for at in range(len(in_order))
    )
