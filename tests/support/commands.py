"""Results of commands as a user meets them, run in the process of the tests."""

from typing import NamedTuple


class Result(NamedTuple):
    status: int
    out: str
    err: str
