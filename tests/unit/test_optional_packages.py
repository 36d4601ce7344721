"""The command line and the server start without optional packages: `pip install relume` has none of them."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[2]


def optional_modules() -> set[str]:
    """Import names of the packages of the extras, other than those for development."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {name: needs for name, needs in project["optional-dependencies"].items() if name != "dev"}
    names = {re.split(r"[>=\[]", need)[0] for needs in extras.values() for need in needs} - {
        "relume",
        "websockets",
    }  # uvicorn brings the latter
    needed = {re.split(r"[>=\[]", need)[0] for need in project["dependencies"]}
    distributions = packages_distributions()
    return {module for module, owners in distributions.items() if set(map(str.lower, owners)) & (names - needed)}


def test_programs_start_without_optional_packages(tmp_path: Path) -> None:
    missing = sorted(optional_modules())
    assert {"pg8000", "pxr", "MaterialX"} <= set(missing)
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({missing}))\n"
        "import relume_cli.main, relume_server.app, relume_worker.service, relume_bench.registry\n"
        "from relume_worker.database import open_database\n"
        f"open_database('sqlite:///{tmp_path / 'relume.db'}').dispose()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
