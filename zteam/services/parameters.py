"""Requests and replies of the queries for parameters; the queries have the names of ROS's services."""

from typing import Any

import msgspec

from zteam.behaviors.parameters import Parameter
from zteam.bus import Change

DESCRIBE = "describe_parameters"
SET = "set_parameters"


class DescribeReply(msgspec.Struct):
    """The parameters of a robot's behaviour, and their values."""

    behavior: str
    """Its name, as `--behavior` takes it."""
    parameters: list[Parameter]
    values: dict[str, Any]
    """By name. A number that JSON lacks, such as infinity, is null."""


class SetRequest(Change, kw_only=True):
    """Give these parameters these values: all of them, or none if one is refused."""

    parameters: dict[str, Any]


class SetReply(msgspec.Struct):
    """The values of all parameters from the next step on."""

    values: dict[str, Any]
    refused: str = ""
    """Why nothing was set; empty if it was."""
