"""`python -m zteam.behaviors.jit_warmup`: compiles all kernels of behaviours into the cache; a child of a process."""

import sys

from zteam.behaviors.jit import BEHAVIOR_KERNELS
from zteam.behaviors.kernel_samples import call_kernels
from zteam.compiling.kernels import Kernel
from zteam.compiling.warmup import warm_up


def find_kernels() -> list[Kernel]:
    """All kernels that are called from outside of kernels, each with a sample of its arguments."""
    BEHAVIOR_KERNELS.use_plain()
    call_kernels()
    return [kernel for kernel in BEHAVIOR_KERNELS.kernels if kernel.sample is not None]


if __name__ == "__main__":
    sys.exit(warm_up(find_kernels))
