"""Links of the documentation site lead to its own pages, or name a file of the repository."""

import pytest

from studies.site_pages import with_site_links


@pytest.mark.parametrize(
    ("source", "written", "on_the_site"),
    [
        ("README.md", "[safety](docs/safety.md#people)", "[safety](safety.md#people)"),
        ("README.md", '<img src="docs/live-view.png">', '<img src="live-view.png">'),
        ("docs/safety.md", "[flying](flying.md)", "[flying](flying.md)"),
        ("docs/architecture.md", "[how](../CONTRIBUTING.md)", "[how](contributing.md)"),
        ("docs/architecture.md", "![rooms](architecture.svg)", "![rooms](architecture.svg)"),
        ("examples/README.md", "[Python](../docs/python.md)", "[Python](python.md)"),
        ("docs/flying.md", "[PX4](../sitl/px4/README.md)", "PX4 (`sitl/px4/README.md`)"),
        ("README.md", "[LICENSE](LICENSE)", "`LICENSE`"),
        ("README.md", "[elsewhere](https://example.org/a.md)", "[elsewhere](https://example.org/a.md)"),
        ("README.md", "```\n[kept](docs/safety.md)\n```", "```\n[kept](docs/safety.md)\n```"),
    ],
)
def test_a_link(source: str, written: str, on_the_site: str) -> None:
    assert with_site_links(written, source) == on_the_site


def test_a_link_to_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r"docs/safety.md: links to gone.md, expected a file"):
        with_site_links("[gone](gone.md)", "docs/safety.md")
