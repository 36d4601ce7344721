"""Stored BTFs: created, resumed, damaged, deleted; on the command line and over HTTP."""

import io
import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image

from relume.assets.btf import btf_store
from relume.assets.btf.bit_packing import pack
from relume.assets.btf.btf_store import STORE, get_record, load_btf, records, store_btf
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.value_cache import ValueFile
from relume.brdf.term_validation import complete_term
from relume.core.errors import CancelledError, MaterialError, NotFoundError, ParameterError
from relume.synthetic_btf.synthesize import SyntheticBtf, synthesize_btf
from relume_cli.main import main
from relume_server.app import create_app
from relume_server.client_state.look_state import LookState
from relume_server.client_state.visible_views import VisibleViews
from relume_server.schemas.renders import RenderRequest
from relume_server.settings import Settings
from relume_worker.database.models import JobRow
from relume_worker.lease import new_owner


def test_a_stored_btf_is_found_by_its_name(small_btf):
    record = small_btf.record
    assert record.synthetic == "mesh"
    assert record.size == (16, 16)
    assert record.error[-1] < 0.03
    assert records(small_btf.folder) == [record]
    assert 0.02 < np.ptp(load_btf(record.data).height) < 0.12  # of the cords
    assert load_btf(record.data).num_components == record.components
    term = complete_term(("terms", 0), record.terms()[0], None)
    assert term["params"] == {"scale": 1.0, "rotation": 0.0, "components": 16}
    assert not (small_btf.folder / "making").exists() or not list((small_btf.folder / "making").iterdir())


@pytest.mark.parametrize("data", ["btf:0123456789abcdef", "merl:0123456789abcdef", "btf:../../x", 3, None])
def test_a_look_with_an_unknown_btf_is_rejected(small_btf, data):
    with pytest.raises(ParameterError, match="imported here"):
        complete_term(("terms", 0), {"model": "measured_btf", "data": data}, None)


@pytest.mark.parametrize("array", ["packed", "mean", "eigen", "step", "average", "levels", "height"])
@pytest.mark.parametrize("how", ["gone", "cut", "shape", "numbers"])
def test_damaged_files_are_reported(small_btf, tmp_path, array, how):
    shutil.copytree(small_btf.folder / small_btf.record.id, tmp_path / small_btf.record.id)
    path = tmp_path / small_btf.record.id / f"{array}.npy"
    values = np.load(path)
    if how == "gone":
        path.unlink()
        if array == "height":  # older stores have none
            assert btf_store._load(path.parent).height.tolist() == [[0.0]]
            return
    elif how == "cut":
        path.write_bytes(path.read_bytes()[:-5])
    elif how == "shape":
        np.save(path, values[:-1])
    else:
        np.save(path, np.full_like(values, -1 if array == "levels" else 0) * (
            np.nan if values.dtype.kind == "f" else 1))  # fmt: skip
        if array in ("eigen", "packed"):
            pytest.skip("any steps are sound")
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


def changed(path, **changes):
    document = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in document.items() if value is not None}))


@pytest.mark.parametrize("are_packed", [False, True])
def test_unpacked_clusters_and_weights_are_still_read(small_btf, tmp_path, are_packed):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    expected = load_btf(small_btf.record.data)
    np.save(at / "cluster.npy", expected.cluster)
    if are_packed:  # only the weights
        np.save(at / "packed.npy", np.stack([pack(weight, expected.bits) for weight in expected.weight]))
    else:
        np.save(at / "weight.npy", expected.weight)
        (at / "packed.npy").unlink()
        changed(at / "btf.json", bits=None)
    changed(at / "btf.json", cluster_bits=None)
    assert get_record(tmp_path, small_btf.record.id).components == expected.num_components
    btf = btf_store._load(at)
    np.testing.assert_array_equal(btf.weight, expected.weight)
    np.testing.assert_array_equal(btf.cluster, expected.cluster)
    assert btf.bits.tolist() == (expected.bits.tolist() if are_packed else [8] * expected.num_components)


def test_the_reported_bytes_are_the_bytes_on_disk(small_btf):
    """Except for the coarser levels, headers of 128 bytes, and the average, which lists read."""
    btf, folder = load_btf(small_btf.record.data), small_btf.folder / small_btf.record.id
    texels, all_texels = btf.size[0] * btf.size[1], btf.cluster.shape[1]
    on_disk = {path.stem: path.stat().st_size - 128 for path in folder.glob("*.npy")}
    assert on_disk["packed"] == pytest.approx(
        (btf.num_bytes - sum(on_disk[name] for name in ("mean", "eigen", "step", "height"))) * all_texels / texels,
        abs=2 * len(btf.cluster),
    )


@pytest.mark.parametrize(
    "changes",
    [*({"bits": bits} for bits in ([], [8] * 17, [9], [1], ["x"], [3], 7)),
     *({"cluster_bits": bits} for bits in (0, 3, 7, 300, "x"))],
)  # fmt: skip
def test_inconsistent_bit_widths_are_damage(small_btf, tmp_path, changes):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    changed(at / "btf.json", **changes)
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


def test_a_damaged_btf_does_not_hide_others_from_lists(small_btf, tmp_path, caplog):
    for name in (small_btf.record.id, "0123456789abcdef"):
        shutil.copytree(small_btf.folder / small_btf.record.id, tmp_path / name)
    (tmp_path / "0123456789abcdef" / "step.npy").unlink()
    assert records(tmp_path) == [small_btf.record]
    assert "0123456789abcdef is damaged" in caplog.text


@pytest.mark.slow
def test_a_resumed_creation_gives_the_same_result(tmp_path):
    requested = []

    def after_some():
        requested.append(0)
        return len(requested) > 20

    wanted, (at_once, resumed) = SyntheticBtf("corduroy", 8, 1, 0.02), (tmp_path / "at once", tmp_path / "resumed")
    whole = synthesize_btf(at_once, wanted, "Corduroy", lambda fraction: None, lambda: False)
    with pytest.raises(CancelledError):
        synthesize_btf(resumed, wanted, "Corduroy", lambda fraction: None, after_some)
    (begun,) = (resumed / "making").iterdir()
    done = int((begun / "done").read_text())
    assert 5 < done < 81
    fractions = []
    record = synthesize_btf(resumed, wanted, "Corduroy", fractions.append, lambda: False)
    assert fractions[0] == pytest.approx(0.8 * done / 81)
    assert record.id == whole.id
    for array in [*btf_store._ARRAYS, "packed"]:
        resumed_array, complete_array = (np.load(folder / record.id / f"{array}.npy") for folder in (resumed, at_once))
        np.testing.assert_array_equal(resumed_array, complete_array)


def test_values_of_another_btf_are_not_reused(tmp_path):
    ValueFile(tmp_path, ubo_grid(), (8, 8))
    with pytest.raises(MaterialError, match="another BTF"):
        ValueFile(tmp_path, ubo_grid(), (8, 9))
    (tmp_path / "done").write_text("x")
    assert ValueFile(tmp_path, ubo_grid(), (8, 8)).num_done == 0


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (SyntheticBtf("wool", 16, 1, 0.1), "weave"),
        (SyntheticBtf("weave", 0, 1, 0.1), "texels"),
        (SyntheticBtf("weave", 1 << 20, 1, 0.1), "texels"),
        (SyntheticBtf("weave", 16, 0, 0.1), "1 to 8"),
        (SyntheticBtf("weave", 16, 1, float("nan")), "0.5"),
    ],
)
def test_invalid_recipes_are_rejected(tmp_path, wanted, message):
    with pytest.raises(ParameterError, match=message):
        synthesize_btf(tmp_path, wanted, "x", lambda fraction: None, lambda: False)


def test_command_line_creates_and_rest_lists_shows_and_deletes(tmp_path, capsys):
    data = tmp_path / "data"
    arguments = ["material", "make-btf", "pebbles", "--size", "8", "--grid", "1", "--data", str(data)]
    assert main(arguments) == 0
    output = capsys.readouterr()
    name, terms, words = output.out.strip(), *output.err.splitlines()[-2:]
    assert json.loads(terms)["terms"][0] == {"model": "measured_btf", "data": name, "texture": None}
    assert "relative RMS" in words
    assert main(["material", "make-btf", "wool", "--data", str(data)]) == 1
    assert "weave, pebbles, corduroy" in capsys.readouterr().err
    settings = Settings(data=data, client=tmp_path / "client", allowed_hosts=["testserver"])
    with TestClient(create_app(settings)) as client:
        (listed,) = client.get("/api/materials/btf").json()
        assert (listed["data"], listed["synthetic"], listed["name"]) == (name, "pebbles", "Pebbles (synthetic)")
        assert client.get(f"/api/materials/btf/{listed['id']}").json() == listed
        ball = np.asarray(Image.open(io.BytesIO(client.get(listed["thumbnail"]).content)), int)
        assert ball[24:40, 24:40].mean() > 10
        (model,) = [entry for entry in client.get("/api/models").json() if entry["model"] == "measured_btf"]
        assert (model["needs_data"], model["data_prefix"], model["curves"]) == (True, "btf:", [])
        resumes, bake = client.app.state.services.live.resumes, "0123456789abcdef"
        shows = LookState({"materials": {"Ball": {"terms": []}}}, {"materials": {"Ball": json.loads(terms)}}, 0)
        token = resumes.open(bake, shows, VisibleViews(["front"], "front"))
        rejected = client.delete(f"/api/materials/btf/{listed['id']}")
        assert rejected.status_code == 409
        assert f"a session of bake {bake}" in rejected.json()["detail"]
        resumes.close(token, time.monotonic())
        assert resumes.take(token, bake, time.monotonic()) is not None
        looks = [{"materials": {"Ball": json.loads(terms)}}]
        request = RenderRequest(bake=bake, view="front", looks=looks, format="png").model_dump_json()
        of_another = {"owner": new_owner(), "heartbeat": time.time()}  # another server is working on it
        row = {"id": "f" * 16, "request": request, "state": "running", "done": 0, "created": 0.0, "client": ""}
        with client.app.state.services.bakes.ledger.sessions.begin() as rows:
            rows.add(JobRow(kind="render", **row, is_first=False, **of_another))
        rejected = client.delete(f"/api/materials/btf/{listed['id']}")
        assert (rejected.status_code, "by render ffff" in rejected.json()["detail"]) == (409, True)
        client.delete(f"/api/renders/{row['id']}")
        assert client.delete(f"/api/materials/btf/{listed['id']}").status_code == 204
        assert client.get(f"/api/materials/btf/{listed['id']}").status_code == 404
        assert client.get("/api/materials/btf").json() == []
    with pytest.raises(NotFoundError):
        STORE.resolve(name)


def test_clusters_are_stored_for_any_number_of_clusters(small_btf, tmp_path):
    (source := tmp_path / "five").write_text("5")
    few = load_btf(small_btf.record.data).with_components(2)
    five = replace(few, **{name: np.repeat(getattr(few, name)[:, :1], 5, axis=1) for name in ("mean", "eigen", "step")},
                   cluster=np.random.default_rng(0).integers(0, 5, few.cluster.shape).astype(np.uint8))  # fmt: skip
    loaded = btf_store._load(tmp_path / store_btf(tmp_path, source, "Five", None, lambda: five).id)
    np.testing.assert_array_equal(loaded.cluster, five.cluster)
    np.testing.assert_array_equal(loaded.weight, five.weight)
