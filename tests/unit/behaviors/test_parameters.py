"""Parameters as data: what the fields of a `Params` say."""

import enum
import math
from typing import Annotated, Any, Literal, Optional

import msgspec
import pytest
from msgspec import Meta

from zteam.behaviors.parameters import Parameter, parameters_of, values_of
from zteam.behaviors.registry import BEHAVIORS


class Side(enum.Enum):
    """A choice."""

    LEFT = "left"
    RIGHT = "right"


class Anything:
    """No plain data."""

    def __str__(self) -> str:
        return "anything"


class Params(msgspec.Struct):
    """One field of each kind."""

    leader: Annotated[int, Meta(ge=0)]
    speed: Annotated[float, Meta(gt=0.0, le=2.0, description="m/s")] = 0.5
    side: Side = Side.LEFT
    mode: Literal["fast", "slow"] = "fast"
    gains: list[Annotated[float, Meta(ge=0.0)]] = []
    reach: Annotated[float, Meta(ge=0.0, description="m")] | None = None
    label: Optional[str] = None  # noqa: UP045
    pair: tuple[float, ...] = (1.0, 2.0)
    table: dict[str, int] = msgspec.field(default_factory=lambda: {"a": 1})
    far: float = math.inf
    other: Any = Anything()


def test_each_field_is_described() -> None:
    """Name, type without its annotations, limits and description of its Meta, and default as plain data."""
    assert parameters_of(Params) == [
        Parameter("leader", "int", {"ge": 0}, required=True),
        Parameter("speed", "float", {"gt": 0.0, "le": 2.0}, "m/s", default=0.5),
        Parameter("side", "'left' | 'right'", default="left"),
        Parameter("mode", "'fast' | 'slow'", default="fast"),
        Parameter("gains", "list[float]", default=[]),
        Parameter("reach", "float | None", {"ge": 0.0}, "m"),
        Parameter("label", "str | None"),
        Parameter("pair", "tuple[float, ...]", default=(1.0, 2.0)),
        Parameter("table", "dict[str, int]", default={"a": 1}),
        Parameter("far", "float", default=math.inf),
        Parameter("other", "Any", default="anything"),
    ]


def test_values_are_plain_data_by_name() -> None:
    """Every field is there, also one that has its default."""
    values = values_of(Params(leader=3, side=Side.RIGHT))
    assert list(values) == [each.name for each in parameters_of(Params)]
    assert (values["leader"], values["side"], values["reach"], values["gains"]) == (3, "right", None, [])


def test_a_renamed_field_has_the_name_that_users_write() -> None:
    """Keys of team files and names of parameters are the same."""

    class Renamed(msgspec.Struct, rename="camel"):
        top_speed: float = 1.0

    assert [each.name for each in parameters_of(Renamed)] == ["topSpeed"]
    assert values_of(Renamed()) == {"topSpeed": 1.0}


@pytest.mark.parametrize("name", BEHAVIORS)
def test_every_shipped_parameter_is_described(name: str) -> None:
    """Each has a description, and each number a lowest and a highest value."""
    for each in parameters_of(BEHAVIORS[name].Params):
        assert each.description, each.name
        assert set(each.limits) == {"ge", "le"} or each.type not in ("int", "float"), each.name
