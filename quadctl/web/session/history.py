"""History of the model's changes: sessions to go back to, and those that were taken back."""

from collections.abc import Callable
from dataclasses import dataclass

from quadctl.web.session.session import Session


@dataclass(frozen=True)
class History:
    """Sessions before and after the present one, as changes of the model have left them."""

    past: tuple[Session, ...] = ()
    future: tuple[Session, ...] = ()

    @property
    def can_undo(self) -> bool:
        return bool(self.past)

    @property
    def can_redo(self) -> bool:
        return bool(self.future)

    def after(self, before: Session) -> "History":
        """History after a change of the session `before`."""
        return History((*self.past, before))

    def undone(self, present: Session) -> tuple[Session, "History"] | None:
        """The session before the last change, with the history there; None where nothing was changed."""
        if not self.past:
            return None
        return self.past[-1], History(self.past[:-1], (*self.future, present))

    def redone(self, present: Session) -> tuple[Session, "History"] | None:
        """The session after the change that was taken back last; None where none was."""
        if not self.future:
            return None
        return self.future[-1], History((*self.past, present), self.future[:-1])

    def each(self, change: Callable[[Session], Session]) -> "History":
        """History with every session changed, as where other flights are open."""
        return History(tuple(map(change, self.past)), tuple(map(change, self.future)))
