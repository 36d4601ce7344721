"""Visible views of a client, and the focused one."""

from __future__ import annotations

from collections.abc import Sequence

from relume.core.errors import ParameterError


class VisibleViews:
    """Set by the receiver, read by the frame loop; both on the event loop.

    Attributes:
        names: views in the client's order. focus: the view under the pointer, served first.
        resend_names: views requested since the last turn of the frame loop, of which the client has nothing.
    """

    def __init__(self, names: Sequence[str], focus: str) -> None:
        self.names, self.focus = tuple(names), focus
        self.resend_names: set[str] = set()

    def show(self, names: Sequence[str]) -> None:
        """Show these views from now on; the focus is kept if it is one of them."""
        self.names = tuple(dict.fromkeys(names))
        self.resend_names.update(self.names)
        self._clamp_focus()

    def hide(self, name: str) -> None:
        """Hide one of several views that cannot be shown."""
        self.names = tuple(view_name for view_name in self.names if view_name != name)
        self._clamp_focus()

    def _clamp_focus(self) -> None:
        if self.focus not in self.names:
            self.focus = self.names[0]

    def set_focus(self, name: str) -> None:
        """Set the focus.

        Raises:
            ParameterError: the view is not visible.
        """
        self.focus = self.check(name)

    def check(self, name: str) -> str:
        """Return the name of a visible view. Raises ParameterError for any other."""
        if name not in self.names:
            raise ParameterError("view", name, "one of the displayed views: " + ", ".join(self.names)[:400])
        return name
