"""What every message type is made of: its base class, how a field stands on the wire, defaults of arrays."""

from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.errors import UsageError

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


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    # Messages share their defaults, so no message may write into them.
    array.flags.writeable = False
    return array


NO_UINT8: NDArray[np.uint8] = _frozen(np.zeros(0, np.uint8))
NO_INT8: NDArray[np.int8] = _frozen(np.zeros(0, np.int8))
NO_INT32: NDArray[np.int32] = _frozen(np.zeros(0, np.int32))
NO_FLOAT32: NDArray[np.float32] = _frozen(np.zeros(0, np.float32))
NO_FLOAT64: NDArray[np.float64] = _frozen(np.zeros(0, np.float64))
NO_BOOL: NDArray[np.bool_] = _frozen(np.zeros(0, np.bool_))
NO_COVARIANCE: NDArray[np.float64] = _frozen(np.zeros(36, np.float64))
NO_COVARIANCE3: NDArray[np.float64] = _frozen(np.zeros(9, np.float64))


REGISTERED: dict[str, type["Message"]] = {}
"""Every message type that is imported, by its full ROS name."""


class Message(msgspec.Struct, eq=False, gc=False):
    """Base of all messages. `ros_type` is the type's full ROS name, such as `geometry_msgs/msg/Twist`.

    A subclass of your own gives a `ros_type` and fields annotated with a message type, `str`, `list[...]` of these, or
    one of `bool_`, `int8`, `float64`, `Float32Seq`, … of this module; every field has a default. Raises UsageError
    where `ros_type` is no ROS name or is a type of zteam's own.

    The garbage collector leaves messages alone: their types admit no cycles, and a team makes a great many of them.
    """

    ros_type: ClassVar[str] = ""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # Only the name: the class has no fields yet. Its codec is generated at its first use.
        if "ros_type" in vars(cls):
            _register(cls)

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f), getattr(other, f)) for f in self.__struct_fields__)

    def __ne__(self, other: object) -> bool:
        # Struct has an identity-based one of its own, which would be found before the negation of __eq__.
        return not self == other

    __hash__ = None  # type: ignore[assignment]


def _register(kind: type[Message]) -> None:
    name = kind.ros_type
    parts = name.split("/")
    if len(parts) != 3 or parts[1] != "msg" or not all(part.isidentifier() for part in parts):
        raise UsageError(f"{kind.__name__}: ros_type is {name!r}; write it as 'my_msgs/msg/{kind.__name__}'")
    known = REGISTERED.get(name)
    if known is not None and known.__module__.rpartition(".")[0] == __package__:
        raise UsageError(f"{kind.__name__}: {name} is a type of zteam's own; choose another package name")
    # A class that is defined anew, as in a notebook, replaces the one before.
    REGISTERED[name] = kind


def _same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(a, b, equal_nan=True)) if isinstance(a, np.ndarray) else bool(a == b)
