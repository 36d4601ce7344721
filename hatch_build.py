"""Build hook: distributions contain the built editor, so that `pip install` needs no Node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

EDITOR = "client_web/dist"
PLACES = {"wheel": "relume_server/editor", "sdist": EDITOR}
NOT_BUILT = (
    f"the editor is not built ({EDITOR}/index.html is missing); with Node.js 20.19 or newer and npm, run\n"
    "    cd client_web && npm ci && npm run build\n"
    "or install a wheel or a source distribution of a release, which contain it"
)


class EditorHook(BuildHookInterface[Any]):
    """Adds the built editor; an editable installation reads it from the checkout instead."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Include the editor, or stop if it is not built."""
        if version == "editable":
            return
        editor = Path(self.root) / EDITOR
        if not (editor / "index.html").is_file():
            raise FileNotFoundError(NOT_BUILT)
        build_data["force_include"][str(editor)] = PLACES[self.target_name]
