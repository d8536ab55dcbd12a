"""What every message type is made of: base class, fields and their forms on the wire, defaults; types by name."""

import difflib
from functools import cache, lru_cache
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.config.entry_points import MESSAGES, load_offered, offered
from zteam.errors import UsageError, log

bool_ = Annotated[bool, "bool"]
int8 = Annotated[int, "int8"]
uint8 = Annotated[int, "uint8"]
int32 = Annotated[int, "int32"]
uint32 = Annotated[int, "uint32"]
uint64 = Annotated[int, "uint64"]
float32 = Annotated[float, "float32"]
float64 = Annotated[float, "float64"]
Uint8Seq = Annotated[NDArray[np.uint8], "uint8[]"]
Int8Seq = Annotated[NDArray[np.int8], "int8[]"]
Int32Seq = Annotated[NDArray[np.int32], "int32[]"]
BoolSeq = Annotated[NDArray[np.bool_], "bool[]"]
Float64Seq = Annotated[NDArray[np.float64], "float64[]"]
Float32Seq = Annotated[NDArray[np.float32], "float32[]"]
Covariance = Annotated[NDArray[np.float64], "float64[36]"]
Covariance3 = Annotated[NDArray[np.float64], "float64[9]"]

CDR = "application/cdr;"
"""What a message's encoding begins with, before the name of its type."""
RULE = "=" * 80
"""Above each type that another one holds."""
_NUMBERS = {"bool", "int8", "uint8", "int32", "uint32", "uint64", "float32", "float64"}
_IN_ARRAYS = _NUMBERS - {"uint32", "uint64"}
_COUNTS = {None: "", 0: "[]"}


@cache
def zeros(dtype: str, count: int = 0) -> NDArray[Any]:
    """An array that messages share as their default, so that none may write into it."""
    array = np.zeros(count, dtype)
    array.flags.writeable = False
    return array


REGISTERED: dict[str, type["Message"]] = {}
"""Every message type that is imported, by its full ROS name."""


class Message(msgspec.Struct, eq=False, gc=False):
    """Base of all messages. `ros_type` is the type's full ROS name, such as `geometry_msgs/msg/Twist`.

    Those of zteam's own have the package of their module's name, unless they give another one.

    A subclass of your own gives a `ros_type` and fields annotated with a message type, `str`, `list[...]` of these, or
    one of `bool_`, `int8`, `float64`, `Float32Seq`, … of this module; every field has a default. Raises UsageError
    where `ros_type` is no ROS name or is a type of zteam's own.

    The garbage collector leaves messages alone: their types admit no cycles, and a team makes a great many of them.
    """

    ros_type: ClassVar[str] = ""
    earlier: ClassVar["type[Message] | None"] = None
    """Its type before its last fields came, if its bytes are read as well."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        package, _, module = cls.__module__.rpartition(".")
        if "ros_type" not in vars(cls) and package == __package__:
            cls.ros_type = f"{module}/msg/{cls.__name__}"
        name = vars(cls).get("ros_type")
        if not name:
            return
        parts = name.split("/")
        if len(parts) != 3 or parts[1] != "msg" or not all(part.isidentifier() for part in parts):
            raise UsageError(f"{cls.__name__}: ros_type is {name!r}; write it as 'my_msgs/msg/{cls.__name__}'")
        known = REGISTERED.get(name)
        if known is not None and known.__module__.rpartition(".")[0] == __package__:
            raise UsageError(f"{cls.__name__}: {name} is a type of zteam's own; choose another package name")
        # Only the name: the class has no fields yet. Its codec is generated at its first use. A class that is defined
        # anew, as in a notebook, replaces the one before.
        REGISTERED[name] = cls

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f), getattr(other, f)) for f in self.__struct_fields__)

    def __ne__(self, other: object) -> bool:
        # Struct has an identity-based one of its own, which would be found before the negation of __eq__.
        return not self == other

    __hash__ = None  # type: ignore[assignment]


def _same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(a, b, equal_nan=True)) if isinstance(a, np.ndarray) else bool(a == b)


class Field(NamedTuple):
    """One field of a message type."""

    name: str
    ros_name: str
    """ROS's name of what it holds, such as `float32`, `string` or `std_msgs/Header`."""
    kind: Any
    """`str` or a message type; None for numbers."""
    length: int | None
    """How many: None for a single one, 0 for any number."""

    @property
    def is_message(self) -> bool:
        """Whether it is one message."""
        return self.length is None and self.kind not in (None, str)


@cache
def fields_of(kind: type[Message]) -> tuple[Field, ...]:
    """The fields of a type in wire order. Raises UsageError for one without a form on the wire."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple(_field(name, hints[name], f"{kind.__name__}.{name}") for name in kind.__struct_fields__)


def _field(name: str, hint: Any, place: str) -> Field:
    if get_origin(hint) is list:
        return _field(name, get_args(hint)[0], place)._replace(length=0)
    if hint is str:
        return Field(name, "string", str, None)
    if isinstance(hint, type) and issubclass(hint, Message):
        return Field(name, _short(hint), hint, None)
    form = next((each for each in get_args(hint)[1:] if isinstance(each, str)), "")
    base, bracket, count = form.partition("[")
    if base not in (_IN_ARRAYS if bracket else _NUMBERS):
        raise UsageError(
            f"{place}: {hint} has no form on the wire; use float64, Float64Seq and others of zteam.messages, "
            "str, a message type, or a list of these"
        )
    return Field(name, base, None, int(count.removesuffix("]") or 0) if bracket else None)


@cache
def definition_of(kind: type[Message]) -> str:
    """The type's fields as in ROS 2's `.msg` files, then those of all types that it holds, as in `ros2msg` schemas, by
    which foreign readers decode zteam's bytes. Constants are left out."""
    texts: dict[type[Message], str] = {}

    def describe(held: Any) -> None:
        if held not in (None, str, *texts):
            fields = fields_of(held)
            counts = (_COUNTS.get(each.length, f"[{each.length}]") for each in fields)
            texts[held] = "".join(f"{each.ros_name}{n} {each.name}\n" for each, n in zip(fields, counts, strict=True))
            for each in fields:
                describe(each.kind)

    describe(kind)
    first, *others = texts.items()
    return first[1] + "".join(f"{RULE}\nMSG: {_short(each)}\n{text}" for each, text in others)


def _short(kind: type[Message]) -> str:
    return kind.ros_type.replace("/msg/", "/")


def all_types() -> dict[str, type[Message]]:
    """Every message type that is imported by now, by its full ROS name, sorted."""
    return dict(sorted(REGISTERED.items()))


def message_type(name: str) -> type[Message]:
    """The type that a user calls `sensor_msgs/msg/LaserScan`, `sensor_msgs/LaserScan` or `LaserScan`.

    Types of installed packages (entry points `zteam.messages`) are imported if no other type has that name. Raises
    UsageError with the nearest names.
    """
    parts = name.strip("/").split("/")
    found = _by_parts(parts)
    if found is None:
        if len(parts) > 1:
            load_offered(MESSAGES, parts[0])
        else:
            for package in offered(MESSAGES):
                import_offered(package)
        found = _by_parts(parts)
    if found is not None:
        return found
    known = all_types()
    near = difflib.get_close_matches(parts[-1], [t.rpartition("/")[2] for t in known], n=3, cutoff=0.4)
    hint = f"did you mean {', '.join(near)}?" if near else f"known: {', '.join(known)}"
    raise UsageError(f"no message type {name!r}: {hint}")


def _by_parts(parts: list[str]) -> type[Message] | None:
    # In the order of their definition: a bare name means zteam's own type before another package's.
    for ros_type, found in REGISTERED.items():
        package, _, bare = ros_type.split("/")
        if parts in ([package, "msg", bare], [package, bare], [bare]):
            return found
    return None


@cache
def encoding_of(kind: type[Message]) -> str:
    """The Zenoh encoding of a type: `application/cdr;sensor_msgs/msg/LaserScan`."""
    return CDR + kind.ros_type


def type_of_encoding(encoding: str) -> type[Message] | None:
    """The type that an encoding names, or None. Imports it from an installed package where it is not zteam's own."""
    prefix, _, name = encoding.partition(";")
    if prefix != "application/cdr":
        return None
    if name not in REGISTERED:
        import_offered(name.partition("/")[0])
    return REGISTERED.get(name)


@lru_cache(maxsize=1024)
def import_offered(package: str) -> None:
    """Import the message types of `package`, once: tools ask for each message that they see. A broken package is
    logged, because others may have the type."""
    try:
        load_offered(MESSAGES, package)
    except UsageError as error:
        log.warning("%s", error)


def check_message_type(key: str, message_type: Any) -> None:
    """Raise UsageError if `message_type`, which goes over `key`, is no class of messages."""
    if not (isinstance(message_type, type) and issubclass(message_type, Message)):
        shown = getattr(message_type, "__name__", None) or repr(message_type)
        raise UsageError(f"{key}: {shown} is no message type; take a class of zteam.messages, such as Twist")
