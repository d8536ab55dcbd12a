"""Navigation's parts, without a compiler: nothing here is worth one."""

from collections.abc import Iterator

import pytest

from zteam.planning.jit import PLANNING


@pytest.fixture(autouse=True)
def plain_kernels() -> Iterator[None]:
    """Kernels run as plain Python; afterwards as before."""
    before = PLANNING.choice
    PLANNING.use_plain()
    yield
    if before:
        PLANNING.use_compiled()
