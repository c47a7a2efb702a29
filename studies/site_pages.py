"""Gather the pages of the documentation site in build/docs, with links that work there (`make docs`).

The site holds docs/ and the pages that stand elsewhere, such as the README. A link to a file that is no page of the
site, such as a module or a configuration, becomes the path of that file. The generator of the site (mkdocs.yml) only
sees build/docs, so that another one can take its place.
"""

import posixpath
import re
import shutil

from studies.page import ROOT

GATHERED = ROOT / "build" / "docs"
ELSEWHERE = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "examples/README.md": "examples.md",
}
"""Names on the site of the pages outside of docs/, by their path in the repository."""
_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
_IMAGE = re.compile(r'(<img src=")([^"]+)"')
_CODE = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)


def main() -> None:
    """Write build/docs anew."""
    shutil.rmtree(GATHERED, ignore_errors=True)
    shutil.copytree(ROOT / "docs", GATHERED)
    pages = {f"docs/{page.name}": page.name for page in (ROOT / "docs").glob("*.md")}
    for source, name in {**pages, **ELSEWHERE}.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        (GATHERED / name).write_text(with_site_links(text, source), encoding="utf-8")


def with_site_links(markdown: str, source: str) -> str:
    """Rewrite the relative links of the page at `source` from places in the repository to places on the site.

    Raises
    ------
    ValueError
        A link leads to a file that does not exist.
    """

    def link(found: re.Match[str]) -> str:
        mark, text, target = found.groups()
        place = _on_site(target, source)
        if place is not None:
            return f"{mark}[{text}]({place})"
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        return f"`{path}`" if text in path else f"{text} (`{path}`)"

    def image(found: re.Match[str]) -> str:
        return f'{found[1]}{_on_site(found[2], source)}"'

    # Blocks of code are shown as they are.
    parts = _CODE.split(markdown)
    return "".join(part if part.startswith("```") else _IMAGE.sub(image, _LINK.sub(link, part)) for part in parts)


def _on_site(target: str, source: str) -> str | None:
    """Place on the site of a link's target; None for a file that is not on it."""
    if "://" in target or target.startswith("#"):
        return target
    path, mark, anchor = target.partition("#")
    place = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    if not (ROOT / place).exists():
        raise ValueError(f"{source}: links to {target}, expected a file of the repository")
    if place in ELSEWHERE:
        return ELSEWHERE[place] + mark + anchor
    return place.removeprefix("docs/") + mark + anchor if place.startswith("docs/") else None


if __name__ == "__main__":
    main()
