"""Which views a client sees side by side, and which of them it works in."""

from __future__ import annotations

from collections.abc import Sequence

from relume.errors import ParameterError


class ShownViews:
    """Set by the receiving side, followed by the frame loop; both on the event loop.

    Attributes:
        names: views in the client's order. focus: the one under the pointer, served first.
        again: views that the client has asked for since the frame loop looked, and has nothing of.
    """

    def __init__(self, names: Sequence[str], focus: str) -> None:
        self.names, self.focus = tuple(names), focus
        self.again: set[str] = set()

    def show(self, names: Sequence[str]) -> None:
        """Show these from now on; the focus stays where it is one of them."""
        self.names = tuple(dict.fromkeys(names))
        self.again.update(self.names)
        self._keep_focus()

    def hide(self, name: str) -> None:
        """One of several cannot be shown."""
        self.names = tuple(other for other in self.names if other != name)
        self._keep_focus()

    def _keep_focus(self) -> None:
        if self.focus not in self.names:
            self.focus = self.names[0]

    def work_in(self, name: str) -> None:
        """The pointer is in this view now.

        Raises:
            ParameterError: it is not shown.
        """
        self.focus = self.check(name)

    def check(self, name: str) -> str:
        """The name of a shown view. Raises ParameterError for any other."""
        if name not in self.names:
            raise ParameterError("view", name, ", ".join(self.names)[:400] + ", which are shown")
        return name
