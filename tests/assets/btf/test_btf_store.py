"""Stored BTFs: created, resumed, damaged, deleted; on the command line and over HTTP."""

import io
import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest
from bit_packer import pack
from fastapi.testclient import TestClient
from PIL import Image

from relume.assets.btf import btf_store
from relume.assets.btf.btf_store import STORE, get_record, load_btf, records, store_btf
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.local_pca_btf import SharedTexels
from relume.assets.btf.parallax import visible_texels
from relume.assets.btf.stored_arrays import stored_bytes
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


def stored_arrays(folder):
    with np.load(folder / "arrays.npz", allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


@pytest.mark.parametrize("array", ["mean", "mean_step", "eigen", "step", "average", "levels", "height", "weight"])
@pytest.mark.parametrize("how", ["gone", "shape", "type", "numbers"])
def test_damaged_arrays_are_reported(small_btf, tmp_path, array, how):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    arrays = stored_arrays(at)
    values = arrays.pop(array)
    if how == "shape":
        arrays[array] = values[:-1]
    elif how == "type":
        arrays[array] = values.astype(np.float64)
    elif how == "numbers":
        arrays[array] = np.full_like(values, -1 if array == "levels" else 0) * (
            np.nan if values.dtype.kind == "f" else 1)  # fmt: skip
        if array in ("mean", "eigen", "weight"):
            pytest.skip("any steps are sound")
    np.savez_compressed(at / "arrays.npz", **arrays)
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


@pytest.mark.parametrize("keep", [0, 3, 400, -5])
def test_truncated_files_are_reported(small_btf, tmp_path, keep):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    (at / "arrays.npz").write_bytes((at / "arrays.npz").read_bytes()[:keep])
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


def test_too_many_texels_are_damage_before_they_are_allocated(small_btf, tmp_path):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    arrays = stored_arrays(at)
    arrays["levels"][0] = 0, 1 << 20, 1 << 20
    np.savez_compressed(at / "arrays.npz", **arrays)
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


def changed(path, **changes):
    document = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in document.items() if value is not None}))


def as_older_store(folder, btf, bits):
    """Rewrite a folder as older versions did: a file for each array, clusters and weights in few bits."""
    (folder / "arrays.npz").unlink()
    for name in ("levels", "mean", "eigen", "step", "average", "height"):
        np.save(folder / f"{name}.npy", getattr(btf, name))
    width = np.array([max(1, (btf.mean.shape[1] - 1).bit_length())], np.uint8)
    rows = np.concatenate(
        [(btf.cluster - (2 ** (width.astype(int) - 1) - 1)).astype(np.int8)[..., None], btf.weight], 2
    )
    np.save(folder / "packed.npy", np.stack([pack(row, np.append(width, bits)) for row in rows]))
    changed(folder / "btf.json", bits=bits.tolist(), cluster_bits=int(width[0]))


@pytest.mark.parametrize("form", ["packed", "unpacked clusters", "unpacked"])
def test_older_stores_are_still_read(small_btf, tmp_path, form):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    expected = load_btf(small_btf.record.data)
    bits = np.full(expected.num_components, 8, np.uint8)
    as_older_store(at, expected, bits)
    if form != "packed":
        changed(at / "btf.json", cluster_bits=None)
        np.save(at / "cluster.npy", expected.cluster)
        np.save(at / "packed.npy", np.stack([pack(weight, bits) for weight in expected.weight]))
    if form == "unpacked":
        np.save(at / "weight.npy", expected.weight)
        (at / "packed.npy").unlink()
        (at / "height.npy").unlink()
        changed(at / "btf.json", bits=None)
    assert get_record(tmp_path, small_btf.record.id).components == expected.num_components
    btf = btf_store._load(at)
    for name in ("weight", "cluster", "mean", "eigen", "step", "average", "levels"):
        np.testing.assert_array_equal(getattr(btf, name), getattr(expected, name))
    assert btf.height.tolist() == ([[0.0]] if form == "unpacked" else expected.height.tolist())


def test_the_reported_bytes_are_the_bytes_on_disk(small_btf):
    """Except for the coarser levels, a third, and headers of the arrays."""
    btf, file = load_btf(small_btf.record.data), small_btf.folder / small_btf.record.id / "arrays.npz"
    assert stored_bytes(btf) < file.stat().st_size < 1.4 * stored_bytes(btf) + 12 * 400
    assert small_btf.record.ratio == btf.measured_bytes / stored_bytes(btf)


@pytest.mark.parametrize(
    "changes",
    [*({"bits": bits} for bits in ([], [8] * 17, [9], [1], ["x"], [3], 7)),
     *({"cluster_bits": bits} for bits in (0, 3, 7, 300, "x"))],
)  # fmt: skip
def test_inconsistent_bit_widths_are_damage(small_btf, tmp_path, changes):
    at = tmp_path / small_btf.record.id
    shutil.copytree(small_btf.folder / small_btf.record.id, at)
    btf = load_btf(small_btf.record.data)
    as_older_store(at, btf, np.full(btf.num_components, 8, np.uint8))
    changed(at / "btf.json", **changes)
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, small_btf.record.id)


def test_a_damaged_btf_does_not_hide_others_from_lists(small_btf, tmp_path, caplog):
    for name in (small_btf.record.id, "0123456789abcdef"):
        shutil.copytree(small_btf.folder / small_btf.record.id, tmp_path / name)
    (tmp_path / "0123456789abcdef" / "arrays.npz").unlink()
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
    expected = stored_arrays(at_once / record.id)
    for name, array in stored_arrays(resumed / record.id).items():
        np.testing.assert_array_equal(array, expected[name])


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
    for both_or_none in (["weave", "--color", "print.png"], []):
        assert main(["material", "make-btf", *both_or_none, "--data", str(data)]) == 1
        assert "images by --height and --color" in capsys.readouterr().err
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
    tables = {name: np.repeat(getattr(few, name)[:, :1], 5, axis=1) for name in ("mean", "mean_step", "eigen", "step")}
    cluster = np.random.default_rng(0).integers(0, 5, few.cluster.shape).astype(np.uint8)
    five = replace(few, **tables, shared=None, cluster=cluster)
    loaded = btf_store._load(tmp_path / store_btf(tmp_path, source, "Five", None, lambda: five).id)
    np.testing.assert_array_equal(loaded.cluster, five.cluster)
    np.testing.assert_array_equal(loaded.weight, five.weight)


def test_shared_weights_are_stored_once(small_btf, tmp_path):
    (source := tmp_path / "shared").write_text("shared")
    btf = load_btf(small_btf.record.data)
    num = btf.size[0] * btf.size[1]
    shared = SharedTexels(btf.cluster[0, :num], btf.weight[0, :num])
    own, source_texel = (btf.cluster.copy(), btf.weight.copy()), visible_texels(btf.height, btf.grid, btf.size)
    own[0][:, :num], own[1][:, :num] = shared.cluster[source_texel], shared.weight[source_texel]
    whole = replace(btf, cluster=own[0], weight=own[1], shared=shared)
    record = store_btf(tmp_path, source, "Shared", None, lambda: whole)
    loaded = btf_store._load(tmp_path / record.id)
    np.testing.assert_array_equal(loaded.cluster, whole.cluster)
    np.testing.assert_array_equal(loaded.weight, whole.weight)
    assert stored_arrays(tmp_path / record.id)["weight"].shape[2] == whole.weight.shape[1] - num
    arrays = {**stored_arrays(tmp_path / record.id), "shared_cluster": shared.cluster[:-1]}
    np.savez_compressed(tmp_path / record.id / "arrays.npz", **arrays)
    shutil.copytree(tmp_path / record.id, tmp_path / "0123456789abcdef")
    with pytest.raises(MaterialError, match="damaged"):
        get_record(tmp_path, "0123456789abcdef")
