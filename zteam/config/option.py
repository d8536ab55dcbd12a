"""Options of a command line that are declared with the fields of a struct."""

from typing import Annotated, Any

import msgspec

SEEDS = (-(2**63), 2**63 - 1, "a seed")


def option(text: str, metavar: str | None = None, **keywords: Any) -> msgspec.Meta:
    """Makes a field an option, as in `Annotated[float, option("cell size", "M", typed=(0.1, 9.0, "metres"))]`.

    `keywords` are those of `add_argument`, and two more. `flag` is the option's name, by default the field's, with "no"
    in front if the field is true by default. `typed` bounds what a user may type: lowest and highest value, and the
    unit that an error asks for. It does not bound the field: a launcher may give an infinite time-out.
    """
    return msgspec.Meta(description=text, extra={"metavar": metavar, **keywords} if metavar else keywords)


Seed = Annotated[int, option("seed of all random numbers", typed=SEEDS)]
