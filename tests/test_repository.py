"""No large files and no stray binaries are in the repository."""

import subprocess
from pathlib import Path

import pytest

from tests.support.places import ROOT


def strays(*files: Path | str) -> list[str]:
    """Lines that `.ci/no-strays` says of files."""
    done = subprocess.run([ROOT / ".ci/no-strays", *files], cwd=ROOT, capture_output=True, text=True, check=False)
    said = done.stderr.splitlines()
    assert done.returncode == (1 if said else 0)
    return said


def test_no_large_file_and_no_stray_binary_is_in_it() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("this is no git checkout")
    assert strays(*listed.stdout.splitlines()) == []


def test_each_stray_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.whl").write_bytes(b"PK\x03\x04\x00\x00")
    (tmp_path / "log.csv").write_text("0.1,0.2\n" * 100_000)
    (tmp_path / "a.py").write_text("print('é')\n")
    (tmp_path / "py.typed").touch()
    said = strays(*sorted(tmp_path.iterdir()))
    assert [line.partition(": ")[2].partition(",")[0] for line in said] == ["is a binary", "is larger than 500 kB"]
