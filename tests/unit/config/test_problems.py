"""Mistakes in a table, in words that name the value and what is expected."""

from typing import Annotated, Any, Literal

import msgspec
import numpy as np
import pytest

from zteam.config.problems import CheckedOptions, problems_of
from zteam.config.simulation_options import Options
from zteam.navigation.planning.costmap import CostmapOptions
from zteam.navigation.planning.planner import AStarOptions


class Table(msgspec.Struct, forbid_unknown_fields=True):
    """One key of each kind."""

    share: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0
    name: Annotated[str, msgspec.Meta(min_length=1)] = "x"
    pose: tuple[float, float, float] = (0, 0, 0)
    on: bool = False
    leader: int | None = None
    kind: Annotated[Literal["amcl", "fake"] | None, msgspec.Meta(description="how")] = None
    few: Annotated[list[int], msgspec.Meta(max_length=2)] = []


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"share": "fast"}, 'share: a number is expected, not "fast"'),
        ({"share": 2.5}, "share: a number of at most 1 is expected, not 2.5"),
        ({"name": ""}, 'name: a text of at least 1 character is expected, not ""'),
        ({"pose": [1, 2]}, "pose: a list of 3 values is expected, not [1, 2]"),
        ({"pose": [1, 2, "x"]}, 'pose[2]: a number is expected, not "x"'),
        ({"on": 1}, "on: true or false is expected, not 1"),
        ({"leader": "s"}, 'leader: a whole number is expected, not "s"'),
        ({"kind": "gps"}, "kind: Invalid enum value 'gps'; one of amcl, fake"),
        ({"few": [1, 2, 3]}, "few: a list of at most 2 values is expected, not [1, 2, 3]"),
        ({"share": "x" * 99}, f'share: a number is expected, not "{"x" * 38}…'),
    ],
)
def test_a_mistake_names_the_value_and_what_is_expected(table: dict[str, Any], told: str) -> None:
    """The words are those of a team file's author, not those of a type checker."""
    assert list(map(str, problems_of(table, Table))) == [told]


@pytest.mark.parametrize(
    ("kind", "key", "value", "kept"),
    [
        (Options, "odom_alphas", (np.float64(0.5),) * 4, (0.5,) * 4),
        (Options, "odom_alphas", np.full(4, 0.5), (0.5,) * 4),
        (AStarOptions, "tolerance", np.float32(0.5), 0.5),
        (CostmapOptions, "lethal_cost_threshold", np.int64(100), 100),
    ],
)
def test_options_take_numbers_of_numpy_and_keep_them_as_pythons_own(
    kind: type[CheckedOptions], key: str, value: Any, kept: Any
) -> None:
    """Also within lists, since a process gets its options as bytes."""
    options = kind(**{key: value})
    assert getattr(options, key) == kept
    assert msgspec.msgpack.encode(options) == msgspec.msgpack.encode(kind(**{key: kept}))
