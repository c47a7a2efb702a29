"""Output in an encoding that lacks characters, as that of a pipe on Windows (cp1252): others take their place."""

import codecs
import io
import sys
import unicodedata

PLAIN = {
    "\N{MINUS SIGN}": "-",
    "\N{SQUARE ROOT}": "sqrt",
    "\N{RIGHTWARDS ARROW}": "->",
    "\N{BRAILLE PATTERN BLANK}": " ",
}
BRAILLE = range(0x2800, 0x2900)
"""Characters that drawings are made of."""
NAME = "quadctl.plain"


def print_what_the_encoding_has() -> None:
    """Have what is printed written with other characters where the encoding lacks its own."""
    codecs.register_error(NAME, _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=NAME)


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(map(_in_ascii, missing)), error.end


def _in_ascii(character: str) -> str:
    if character in PLAIN:
        return PLAIN[character]
    if ord(character) in BRAILLE:
        return "*"
    letters = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return letters or "?"
