"""Memory of a process that works on long logs: what is freed goes back to the system."""

import contextlib
import ctypes
import gc
import os

M_MMAP_THRESHOLD = -3
"""Parameter of glibc's `mallopt`."""
LARGE_BYTES = 32 << 20
"""Size of an array whose memory is returned when it is freed. It costs time to get it anew: what a fit makes for every
prediction, even of a million rows, is smaller, and stays in the heap."""

OTHER_LIBRARY = (OSError, AttributeError, TypeError)
"""Ways in which a system says that its C library is none of GNU; on Windows the program itself is not a library."""


def return_freed_memory() -> None:
    """Have the memory of large arrays returned as soon as they are freed, in the whole process.

    Otherwise glibc takes ever larger arrays from its heap, which keeps what lies between those that are still in use,
    and the allocator of polars keeps what it has freed for seconds.
    """
    os.environ.setdefault("_RJEM_MALLOC_CONF", "dirty_decay_ms:0,muzzy_decay_ms:0")  # read when polars is loaded
    with contextlib.suppress(*OTHER_LIBRARY):
        ctypes.CDLL(None).mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)


def give_memory_back() -> None:
    """Free what nothing needs any more: datasets hold each other in circles, and glibc keeps freed arrays of its
    heap."""
    gc.collect()
    with contextlib.suppress(*OTHER_LIBRARY):
        ctypes.CDLL(None).malloc_trim(0)
