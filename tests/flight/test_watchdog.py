"""The watchdog ends a process that hangs, and no other."""

import subprocess
import sys
import textwrap

import pytest

from tests.support.places import ROOT

HANGS = "time.sleep(60.0)"
TICKS = "[(watchdog(None), time.sleep(0.02)) for _ in range(50)]"
HOLDS_THE_INTERPRETER = "ctypes.PyDLL(None).usleep(60_000_000)"


def run(what: str) -> subprocess.CompletedProcess[str]:
    """A process with a watchdog of 0.3 s that does `what`, then says that it is done."""
    program = f"""
    import ctypes, time
    from quadctl.flight import watchdog as w
    w.HANG_S, w.REARM_S = 0.3, 0.1
    with w.Watchdog() as watchdog:
        {what}
    time.sleep(0.5)
    print("done")
    """
    words = [sys.executable, "-c", textwrap.dedent(program)]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=50.0, check=False)


@pytest.mark.parametrize("what", [HANGS, HOLDS_THE_INTERPRETER])
def test_a_process_that_hangs_is_ended_with_a_traceback(what: str) -> None:
    ended = run(what)
    assert ended.returncode == 1
    assert "Timeout" in ended.stderr
    assert "done" not in ended.stdout


def test_ticks_keep_it_alive_and_after_the_flight_it_may_take_its_time() -> None:
    ended = run(TICKS)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == "done\n"
