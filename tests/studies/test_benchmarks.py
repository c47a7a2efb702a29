"""Pages of the benchmarks: the table is that of the last run, the notes below it are kept."""

from pathlib import Path

from studies.benchmarks import control_loop, run
from studies.benchmarks.control_loop import Row
from studies.page import NOTES, write_page
from tests.support.places import ROOT

PAGES = {"benchmarks.md": run.ABOUT, "control-loop.md": control_loop.ABOUT}


class TestPage:
    def test_the_notes_outlast_another_run(self, tmp_path: Path) -> None:
        page = tmp_path / "page.md"
        write_page(page, "# Title\n\n| old |\n")
        assert page.read_text() == "# Title\n\n| old |\n"
        page.write_text(f"{page.read_text()}\n{NOTES}\n\nMeasured on a busy machine.\n")
        write_page(page, "# Title\n\n| new |")
        assert page.read_text() == f"# Title\n\n| new |\n\n{NOTES}\n\nMeasured on a busy machine.\n"

    def test_the_pages_say_what_the_generators_say(self) -> None:
        for page, about in PAGES.items():
            text = (ROOT / "docs" / page).read_text()
            before, *_, after = about.replace("{seconds:g}", "60").split("{machine}")
            assert text.startswith(before), page
            assert after.strip() in text, page

    def test_a_missed_goal_is_named_above_the_table(self) -> None:
        rows = [Row("sleep", ("1 ms",), "< 2 ms", True), Row("wake", ("3 ms",), "< 2 ms", False)]
        assert "\nGoals missed: wake.\n" in control_loop._page(rows, 60.0)
