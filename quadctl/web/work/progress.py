"""The callback by which a job reports the step that it begins."""

from collections.abc import Callable

Progress = Callable[[str], None]
"""Called with a few words on the step that begins."""
