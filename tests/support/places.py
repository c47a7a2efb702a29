"""Folders that tests read from."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
"""The repository."""
DATA = ROOT.parent / "shared" / "data"
"""Public flight logs beside the repository; not everywhere there."""
VEHICLES, MISSIONS = ROOT / "config" / "vehicles", ROOT / "missions"
RAPTOR = VEHICLES / "raptor.yaml"
NO_CHROMIUM = "there is no Chromium on this machine"
"""Why a test of a page is left out."""
