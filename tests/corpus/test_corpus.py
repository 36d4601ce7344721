"""Every file of the corpus ends as in the committed table; `make corpus` rewrites it."""

from __future__ import annotations

import os
import shutil
import warnings
from pathlib import Path

import pytest
from corpus_outcomes import differences, list_files, outcome_of, read_table, summary, write_table

TABLE = Path(__file__).with_name("outcomes.json")
SAMPLE_STEP, SAMPLE_BYTES = 12, 20_000


@pytest.fixture(autouse=True)
def decoders_warnings() -> None:
    """Warnings of libraries about damaged files are not ours."""
    warnings.simplefilter("ignore")


def check(root: Path, table: Path, names: list[str]) -> None:
    changed = differences(read_table(table), {name: outcome_of(root, name) for name in names})
    if changed:
        listed = "\n".join(changed[:40])
        pytest.fail(f"{len(changed)} outcomes differ; if they are right, run make corpus:\n{listed}", pytrace=False)


def test_small_files_end_as_in_the_table(shared_data: Path) -> None:
    small = [name for name in read_table(TABLE) if (shared_data / name).stat().st_size < SAMPLE_BYTES]
    check(shared_data, TABLE, small[::SAMPLE_STEP])


def test_the_table_has_the_files_of_the_corpus(shared_data: Path) -> None:
    table = read_table(TABLE)
    assert sorted(table) == sorted(list_files(shared_data))
    assert [name for name, outcome in table.items() if outcome["outcome"] == "crashed"] == []


@pytest.mark.slow
def test_all_files_end_as_in_the_table(shared_data: Path) -> None:
    check(shared_data, TABLE, [*read_table(TABLE)])


@pytest.mark.slow
def test_files_of_another_corpus_end_as_in_its_table() -> None:
    folder = os.environ.get("RELUME_CORPUS")
    if folder is None:
        pytest.skip("RELUME_CORPUS names no folder of further files")
    table = Path(folder) / "outcomes.json"
    assert table.is_file(), f"there is no {table}; write it by python tests/corpus/write.py {folder}"
    check(Path(folder), table, list_files(Path(folder)))


def test_parts_are_not_opened(tmp_path: Path) -> None:
    """Images and layers that another file of their set names, buffers and libraries are parts."""
    files = {
        "set/car/car.obj": "mtllib car.mtl",
        "set/car/car.mtl": "newmtl a\nmap_Kd -s 1 1 1 textures\\Paint Red.PNG\nmap_Ks gloss.png\n",
        "set/car/textures/paint red.png": "",
        "set/car/gloss.png": "",
        "set/car/cover.png": "",
        "other/car/paint red.png": "",
        "usd/car/root.usda": "@./layers/geo.usd@",
        "usd/car/layers/geo.usd": "asset file = @../map.exr@",
        "usd/car/map.exr": "",
        "a.gltf": '{"images": [{"uri": "b.webp"}]}',
        "b.webp": "",
        "buffer.bin": "",
        "notes.md": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    opened = [
        "a.gltf",
        "b.webp",
        "other/car/paint red.png",
        "set/car/car.obj",
        "set/car/cover.png",
        "usd/car/root.usda",
    ]
    assert list_files(tmp_path) == opened


def test_outcomes_of_three_files(tmp_path: Path) -> None:
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "plain.obj").write_text(triangle)
    (tmp_path / "line.obj").write_text(f"{triangle}l 1 2\n")
    (tmp_path / "empty.obj").write_text("")
    outcomes = {name: outcome_of(tmp_path, name) for name in list_files(tmp_path)}
    assert outcomes["empty.obj"] == {
        "outcome": "refused",
        "reason": "the scene file is empty: 0 bytes; export or download it again",
    }
    (warning,) = outcomes["line.obj"]["warnings"]
    assert outcomes["line.obj"]["outcome"] == "shown with warnings"
    assert warning == "ignored: The file's lines aren't supported; only faces are shown."
    assert outcomes["plain.obj"] == {"outcome": "shown"}
    write_table(tmp_path / "outcomes.json", outcomes)
    assert read_table(tmp_path / "outcomes.json") == outcomes
    assert differences(outcomes, outcomes) == []
    shutil.copy(tmp_path / "line.obj", tmp_path / "plain.obj")
    (changed,) = differences(outcomes, {"plain.obj": outcome_of(tmp_path, "plain.obj")})
    assert changed.startswith("plain.obj\n  was {'outcome': 'shown'}\n  is  {'outcome': 'shown with warnings'")
    assert summary(outcomes).splitlines() == [
        "3 files: 1 refused, 1 shown, 1 shown with warnings",
        "refused although trimesh reads them: 0",
        "     1  the scene file is empty: N bytes; export or download it again",
    ]


def test_a_file_may_name_files_of_its_set_alone(tmp_path: Path) -> None:
    folder = tmp_path / "kind" / "set" / "meshes"
    folder.mkdir(parents=True)
    (folder / "a.obj").write_text("mtllib ../../../m.mtl\nusemtl A\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for place, outcome in ((tmp_path, "shown with warnings"), (folder.parent, "shown")):
        (place / "m.mtl").write_text("newmtl A\nKd 1 0 0\n")
        assert outcome_of(tmp_path, "kind/set/meshes/a.obj")["outcome"] == outcome
        (folder / "a.obj").write_text((folder / "a.obj").read_text().replace("../../../", "../"))
