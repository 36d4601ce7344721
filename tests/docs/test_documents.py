"""Names, folders, terms and settings in the documents agree with the code."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from relume.brdf.registry import TERMS
from relume.brdf.term import VIEW
from relume_server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("docker/*.md")])
SYMBOLS = {
    "alpha": r"\gamma_\alpha",
    "beta": r"\gamma_\beta",
    "tilt_x": r"\gamma_x",
    "tilt_y": r"\gamma_y",
    "lobe": r"\gamma_C",
}
IGNORED_FOLDERS = {"build", "dist", "data", "test-results"}
SOURCES = sorted(
    path
    for folder in (
        "relume",
        "worker",
        "server",
        "cli",
        "client",
        "examples",
        "bench",
        "tests",
        "scripts",
        "client_web/src",
        "client_web/tests",
    )
    for suffix in ("py", "ts", "tsx")
    for path in ROOT.glob(f"{folder}/**/*.{suffix}")
    if "node_modules" not in path.parts and not {".venv-peers", ".venv-cycles"} & set(path.parts)
)


def _read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def _anchor(heading: str) -> str:
    """GitHub's anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def _anchors(page: Path) -> set[str]:
    """Anchors of all headings of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return {_anchor(heading) for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_and_images_resolve(document: Path) -> None:
    text = re.sub(r"```.*?```", "", document.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\[[^\]]*\]\(([^)\s]+)\)", text):
        if target.startswith(("http://", "https://")):
            continue
        path, _, anchor = target.partition("#")
        file = (document.parent / path).resolve() if path else document
        assert file.exists(), f"{target} is not there"
        assert not anchor or anchor in _anchors(file), f"{target} has no such heading"


def test_pages_and_decisions_named_in_code_exist() -> None:
    decisions = {int(page.name[:4]) for page in ROOT.glob("docs/adr/0*.md")}
    references = 0
    for source in SOURCES:
        text = source.read_text(encoding="utf-8")
        for path, anchor in re.findall(r"\b(docs/[\w/-]+\.md)(?:#([\w-]+))?", text):
            references += 1
            assert (ROOT / path).exists(), f"{source} names {path}"
            assert not anchor or anchor in _anchors(ROOT / path), f"{source} names {path}#{anchor}"
        for number in re.findall(r"\bADRs? (\d+)", text):
            references += 1
            assert int(number) in decisions, f"{source} names ADR {number}"
    assert references > 40


PATH = re.compile(r"\b((?:relume|worker|server|cli|bench|tests|client_web|docker|docs)/[\w./-]*\w/?)")
MODULE = re.compile(r"`((?:relume|relume_worker|relume_server|relume_cli|relume_bench)(?:\.[a-z_]\w*)+)")
NOT_MODULES = {"relume.v2", "relume.db"}
EXAMPLES = {"relume/brdf/terms/your_term.py", "bench/.venv-peers", "bench/.venv-cycles", "client_web/dist"}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_named_files_and_modules_exist(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    for path in set(PATH.findall(text)) - EXAMPLES:
        assert (ROOT / path).exists(), f"{path} is not there"
    for name in set(MODULE.findall(text)) - NOT_MODULES:
        assert _is_module_or_of_one(name), f"{name} is not there"


def _is_module_or_of_one(name: str) -> bool:
    module, _, attribute = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        return hasattr(importlib.import_module(module), attribute)
    return True


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_lists_of_files_name_existing_files(document: Path) -> None:
    """A name without a folder is in the folder of the name before it."""
    for listed in re.findall(r"^\*Files?:\*(.*?)\n\n", document.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        folder = None
        for name in re.findall(r"`([^`]+)`", listed):
            folder = Path(name).parent if "/" in name and not name.endswith("/") else folder
            folder = Path(name) if name.endswith("/") else folder
            assert folder is not None, f"{name} stands in no folder"
            path = name if "/" in name else folder / name
            assert (ROOT / path).exists(), f"{path} is not there"


def test_folder_map_of_the_readme_matches_ls() -> None:
    section = _read("README.md").split("## Folders")[1]
    documented = set(re.findall(r"^(\w+)/", section.split("```")[1], flags=re.MULTILINE))
    actual = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith((".", "_"))}
    assert documented == {name for name in actual - IGNORED_FOLDERS if not name.endswith(".egg-info")}


def test_method_lists_every_term_and_its_curves() -> None:
    rows = dict(re.findall(r"^\| `(\w+)`[^|]*\|(.*)$", _read("docs/direct-light.md"), flags=re.MULTILINE))
    for model, term in TERMS.items():
        assert model in rows, f"docs/direct-light.md has no row for {model}"
        for curve in (curve for curve in term.curves if curve is not VIEW):
            symbol = SYMBOLS.get(curve.name, "\\" + curve.name)
            assert symbol in rows[model], f"docs/direct-light.md leaves out {curve.name} of {model}"


def test_operations_lists_every_setting_and_no_other() -> None:
    documented = set(re.findall(r"RELUME_[A-Z_]+", _read("docs/operations.md")))
    from_environment = {"RELUME_THREADS", "RELUME_SHARED_DATA", "RELUME_STORAGE", "RELUME_STORAGE_CACHE_BYTES"}
    assert documented == {f"RELUME_{name.upper()}" for name in Settings.model_fields} | from_environment


def test_every_decision_is_in_the_index() -> None:
    index = _read("docs/adr/README.md")
    for page in ROOT.glob("docs/adr/0*.md"):
        title = page.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        assert f"[{title}]({page.name})" in index


def test_citations_are_in_the_references() -> None:
    keys = set(re.findall(r"^@\w+\{(\w+),", _read("docs/references.bib"), flags=re.MULTILINE))
    cited = {key for page in DOCUMENTS for key in re.findall(r"\[`(\w+)`\]\(", page.read_text(encoding="utf-8"))}
    assert cited <= keys


@pytest.mark.parametrize("name", ["requirements.lock", "docker/requirements.lock"])
def test_lock_has_a_hash_for_every_package_and_no_address(name: str) -> None:
    lines = [line for line in _read(name).splitlines() if line and not line.lstrip().startswith("#")]
    for line in lines:
        assert re.fullmatch(r"[a-z0-9.-]+==\S+( ; [^\\]+)? \\|    --hash=sha256:[0-9a-f]{64}( \\)?", line), line
    packages = sum("==" in line and not line.startswith(" ") for line in lines)
    last_hashes = sum(line.startswith("    --hash") and not line.endswith("\\") for line in lines)
    assert packages == last_hashes > 50
