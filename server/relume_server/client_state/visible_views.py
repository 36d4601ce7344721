"""Which views a client sees side by side, and which of them it works in."""

from __future__ import annotations

from collections.abc import Sequence

from relume.core.errors import ParameterError


class VisibleViews:
    """Set by the receiving side, followed by the frame loop; both on the event loop.

    Attributes:
        names: views in the client's order. focus: the one under the pointer, served first.
        resend_names: views that the client has asked for since the frame loop looked, and has nothing of.
    """

    def __init__(self, names: Sequence[str], focus: str) -> None:
        self.names, self.focus = tuple(names), focus
        self.resend_names: set[str] = set()

    def show(self, names: Sequence[str]) -> None:
        """Show these from now on; the focus stays where it is one of them."""
        self.names = tuple(dict.fromkeys(names))
        self.resend_names.update(self.names)
        self._clamp_focus()

    def hide(self, name: str) -> None:
        """One of several cannot be shown."""
        self.names = tuple(view_name for view_name in self.names if view_name != name)
        self._clamp_focus()

    def _clamp_focus(self) -> None:
        if self.focus not in self.names:
            self.focus = self.names[0]

    def set_focus(self, name: str) -> None:
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
