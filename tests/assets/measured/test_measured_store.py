"""Imported materials: stored completely or not at all, identified by content, found by name."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from relume.assets.measured import measured_store as shelves
from relume.assets.measured.measured_store import STORE, get_record, load_material, records, store_material
from relume.assets.measured.merl import write_merl
from relume.brdf.term_validation import complete_term
from relume.core.errors import MaterialError, NotFoundError, ParameterError


@pytest.fixture
def copied(library, data, tmp_path):
    """Another folder with the same material whose files tests may damage; its path and the material's id."""
    identity = data.removeprefix("merl:")
    shutil.copytree(library / identity, tmp_path / "materials" / identity)
    return tmp_path / "materials", identity


def test_an_import_is_listed_and_can_be_used(library, data, table, planes):
    (record,) = records(library)
    assert (record.name, record.data) == ("Plastic", data)
    assert len(record.id) == 16
    assert max(record.lobes_error) < 0.2
    models = [(term["model"], term["data"], term["texture"]) for term in record.terms()]
    assert models == [("measured_lv", data, None), ("measured_hd", data, None)]
    np.testing.assert_array_equal(load_material(data).table, table)
    assert not load_material(data).table.flags.writeable
    assert sorted(path.name for path in library.iterdir()) == [record.id]


def test_the_source_is_stored_bit_for_bit(library, data, planes, tmp_path):
    write_merl(tmp_path / "again.binary", planes)
    assert shelves.source_path(data).read_bytes() == (tmp_path / "again.binary").read_bytes()


def test_importing_the_same_file_again_only_renames_the_material(copied):
    folder, identity = copied
    created = get_record(folder, identity).created
    store_material(folder, folder / identity / "measured.binary", "Renamed")
    (record,) = records(folder)
    assert (record.id, record.name, record.created) == (identity, "Renamed", created)


def test_another_file_with_the_same_id_is_detected(copied, planes, tmp_path):
    folder, identity = copied
    record = folder / identity / STORE.record
    document = json.loads(record.read_text())
    write_merl(tmp_path / "a.binary", planes)
    assert document["sha256"][:16] == identity
    record.write_text(json.dumps({**document, "sha256": identity + "0" * 48}))
    with pytest.raises(
        MaterialError, match=f"another file has the id of the measured material {identity}; delete that one first"
    ):
        store_material(folder, tmp_path / "a.binary", "Mine")
    assert get_record(folder, identity).name == document["name"]
    del document["sha256"]  # as older stores have it
    record.write_text(json.dumps(document))
    store_material(folder, tmp_path / "a.binary", "Mine")


def test_a_bad_file_leaves_nothing_behind(tmp_path):
    (tmp_path / "bad.binary").write_bytes(b"no")
    with pytest.raises(MaterialError):
        store_material(tmp_path / "materials", tmp_path / "bad.binary", "Bad")
    assert not (tmp_path / "materials").exists()


def test_a_full_library_rejects_imports(library, tmp_path, planes, monkeypatch):
    monkeypatch.setattr(shelves, "STORE", replace(STORE, max_entries=1))
    other = planes.copy()
    other[0, 0, 0, 0] += 1
    write_merl(tmp_path / "other.binary", other)
    with pytest.raises(MaterialError, match="delete one first"):
        store_material(library, tmp_path / "other.binary", "Other")


def test_a_removed_material_is_unknown(copied):
    folder, identity = copied
    with pytest.raises(NotFoundError):
        STORE.remove(folder, "0" * 16)
    STORE.remove(folder, identity)
    assert records(folder) == []
    with pytest.raises(NotFoundError, match="import it first"):
        get_record(folder, identity)


@pytest.mark.parametrize(
    "name", ["", "merl:", "merl:../../../etc/passwd", "merl:0000000000000000", "0000000000000000", "merl:" + "G" * 16]
)
def test_only_names_of_imported_materials_are_known(library, name):
    assert not STORE.exists(name)
    with pytest.raises(NotFoundError):
        load_material(name)


def test_names_are_known_while_their_folder_is_in_use(library, data, copied):
    folder, identity = copied
    (folder / identity).rename(folder / "fedcba9876543210")
    name = "merl:fedcba9876543210"
    assert not STORE.exists(name)
    with STORE.with_search_folder(folder):
        assert STORE.exists(name)
        assert set(STORE.list_names()) >= {name, data}
    assert not STORE.exists(name)


def change(document, key, value):
    return json.dumps({**document, key: value}).encode()


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("material.json", lambda document: b"{"),
        ("material.json", lambda document: b" " * (2 << 20)),
        ("material.json", lambda document: change(document, "format", 99)),
        ("material.json", lambda document: change(document, "lobes", [[1.0]])),
        ("material.json", lambda document: change(document, "homomorphic", None)),
        ("material.json", lambda document: change(document, "lobes", (0 * np.ones((4, 3, 90))).tolist())),
        ("table.npy", lambda document: b""),
        ("table.npy", lambda document: b"\x93NUMPY\x01\x00"),
    ],
)
def test_errors_name_damaged_measured_files(copied, file, content):
    folder, identity = copied
    path = folder / identity / file
    path.write_bytes(content(json.loads((folder / identity / "material.json").read_text())))
    (folder / identity).rename(folder / "fedcba9876543210")
    with STORE.with_search_folder(folder), pytest.raises(MaterialError, match="import it again"):
        load_material("merl:fedcba9876543210")


def test_a_look_accepts_only_known_measured_data(data):
    term = complete_term(("terms", 0), {"model": "measured_hd", "data": data}, None)
    assert (term["data"], term["texture"], term["params"]) == (data, "specular", {})
    for bad in (None, 7, "merl:0000000000000000", "../x", ["merl:"], data + " "):
        with pytest.raises(ParameterError, match=r"terms/0/data is .* imported here: 'merl:"):
            complete_term(("terms", 0), {"model": "measured_hd", "data": bad}, None)
    with pytest.raises(ParameterError, match="imported here"):
        complete_term(("terms", 0), {"model": "measured_lv"}, None)
    with pytest.raises(ParameterError, match="give no data, because 'lambert' has none"):
        complete_term(("terms", 0), {"model": "lambert", "data": data}, None)
