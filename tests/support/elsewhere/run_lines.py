"""Run command lines one after the other in this process, on a console of cp1252; the lines come as JSON on standard
input, and the results (status, output, complaints) leave as JSON on standard output."""

import contextlib
import json
import sys
import traceback
from pathlib import Path

from quadctl.cli import main

CONSOLE = "cp1252"


def run(words: list[str], folder: Path) -> tuple[int, str, str]:
    """Run one line; an error that no user should see is a traceback in its complaints, and status 2."""
    sys.argv = ["quadctl", *words]
    status: int | str | None = 2
    paths = folder / "out.txt", folder / "err.txt"
    with (
        paths[0].open("w", encoding=CONSOLE) as out,
        paths[1].open("w", encoding=CONSOLE) as err,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as ended:
            status = ended.code
        except BaseException:
            err.write(traceback.format_exc().encode("ascii", "replace").decode())
    out_text, err_text = (path.read_text(encoding=CONSOLE) for path in paths)
    return int(status or 0), out_text, err_text


if __name__ == "__main__":
    where = Path(sys.argv[1])
    json.dump([run(words, where) for words in json.load(sys.stdin)], sys.stdout)
