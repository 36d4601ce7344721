"""Commands in pipelines: list, plan, follow, cancel and delete, all with JSON output."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
from btf_zips import zipped
from PIL import Image
from tiny_scenes import still_life

from relume.assets.btf.import_btf import import_btf
from relume.assets.environments.environment import Environment
from relume.core.errors import NotFoundError
from relume.images.image_store import store as store_image
from relume.scene.model import Camera, Material, Mesh
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume_cli.bake_progress import follow
from relume_cli.main import main
from relume_cli.tokens import open_access
from relume_server.persistence.look_store import LookStore
from relume_server.schemas.bodies import BakeBody, DryRunBody, SceneBody
from relume_worker.database.models import JobRow
from relume_worker.paths import btfs_path, images_path
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

TINY = ["--method", "direct", "--size", "32x24", "--lights", "100"]
RED = {"materials": {"White": {"terms": [{"model": "lambert", "color": [1.0, 0.0, 0.0]}]}}}
BLUE = {"materials": {"White": {"terms": [{"model": "lambert", "color": [0.0, 0.0, 1.0]}]}}}


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with the scene "Quad", a white square that fills the picture; baked, with saved looks."""
    folder = tmp_path_factory.mktemp("data")
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    normals, zeros = np.tile(np.array([[0, 0, 1]], np.float32), (4, 1)), np.zeros((4, 4), np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    mesh = Mesh("quad", positions, normals, zeros, zeros[:, :2].copy(), faces, 0)
    camera = np.eye(4)
    camera[2, 3] = 1.5
    material = Material("White", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
    light = Environment("white", np.ones((16, 32, 3), np.float32))
    scene = make_scene("Quad one", [mesh], [material], [Camera("Front", camera, 0.8)], light)
    service = BakeService(folder)
    register_scene(folder, service.ledger, scene)
    looks = LookStore(service.ledger.sessions)
    looks.put("Red night", json.dumps(RED), None, None)
    looks.put("Blue", json.dumps(BLUE), None, None)
    service.close()
    assert main(["bake", "quad_one", "--view", "front", *TINY, "--data", str(folder)]) == 0
    return folder


@pytest.fixture
def run(baked: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[Any]:
    """Run a command on the folder and return its exit code, stdout and stderr."""
    capsys.readouterr()

    def command(*words: str, data: Path = baked) -> tuple[int, str, str]:
        code = main([*words, "--data", str(data)])
        return code, *capsys.readouterr()

    return command


def parsed(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def test_list_lines_begin_with_an_identifier(run: Any) -> None:
    (scene,) = parsed(run("list", "--json")[1])
    assert set(scene) == set(SceneBody.model_fields) - {"thumbnail"}
    assert run("list")[1].startswith(f"{scene['id']} ")
    (bake,) = parsed(run("list", "bakes", "--json")[1])
    assert set(bake) == set(BakeBody.model_fields)
    assert (bake["scene"], bake["id"], bake["state"]) == (scene["id"], scene["bakes"][0], "ready")
    assert run("list", "bakes", "--scene", "QUAD-ONE", "--state", "ready")[1].startswith(bake["id"])
    assert run("list", "bakes", "--state", "failed")[1] == ""
    assert [look["name"] for look in parsed(run("list", "looks", "--json")[1])] == ["Blue", "Red night"]
    environments = [line.split()[0] for line in run("list", "environments")[1].splitlines()]
    assert environments[:2] == ["studio", "clear_sky"]
    for kind in ("materials", "images", "renders"):
        assert run("list", kind, "--json")[:2] == (0, "")
    assert "cornell_box" in [line.split()[0] for line in run("list", "built-ins")[1].splitlines()]


def test_render_whose_request_cannot_be_read_is_listed_as_failed(run: Any, tmp_path: Path) -> None:
    with closing(BakeService(tmp_path)) as service, service.ledger.sessions.begin() as session:
        session.add(JobRow(kind="render", id="r" * 16, request='{"eye":1}', state="queued", done=0, created=0.0))
    code, text, _ = run("list", "renders", data=tmp_path)
    assert (code, text) == (0, f"{'r' * 16}  failed     0 of 1 frames  unknown, png\n")
    (render,) = parsed(run("list", "renders", "--json", data=tmp_path)[1])
    assert render["problem"].endswith("; request it again")


def test_lists_accept_only_meaningful_filters(run: Any) -> None:
    assert "--scene is 'quad'" in run("list", "looks", "--scene", "quad")[2]
    assert "--state is 'ready'" in run("list", "scenes", "--state", "ready")[2]


def test_dry_run_prints_the_cost_and_queues_nothing(run: Any) -> None:
    code, text, _ = run("bake", "quad one", "--preset", "preview", "--dry-run", "--json")
    (plan,) = parsed(text)
    assert code == 0
    assert set(plan) == set(DryRunBody.model_fields)
    assert (plan["recipe"]["size"], plan["recipe"]["lights"]) == ([320, 240], 300)
    assert plan["plan"]["store_bytes"] > 0
    assert len(run("list", "bakes")[1].splitlines()) == 1
    code, text, said = run("bake", "quad one", "--preset", "final", "--lights", "9", "--dry-run")
    assert text.strip() not in ("", plan["id"])
    assert "1024×768, 9 lights" in said
    assert "of disk" in said


def test_repeated_bake_prints_one_line_of_json(run: Any) -> None:
    (bake,) = parsed(run("bake", "quad one", "--view", "FRONT", *TINY, "--json")[1])
    assert set(bake) == set(BakeBody.model_fields)
    assert bake["state"] == "ready"
    assert parsed(run("status", "quad one", "--json")[1])[0]["id"] == bake["id"]
    code, text, said = run("status", "--json")
    assert code == 0, said
    (all_,) = parsed(text)
    assert (all_["scenes"], all_["bakes"], all_["active"]) == (1, {"ready": 1}, [])
    assert f"{bake['id']}  ready  100%" in run("status", bake["id"][:10])[1]


def test_queued_bake_is_canceled_deleted_and_audited(run: Any, baked: Path) -> None:
    _, text, _ = run("bake", "quad one", "--method", "direct", "--size", "24x16", "--lights", "50", "--no-watch")
    bake = text.strip()
    assert f"{bake}  queued" in run("list", "bakes", "--state", "queued")[1]
    assert run("cancel", bake)[:2] == (0, f"{bake}\n")
    code, text, said = run("cancel", bake)
    assert (code, text, said) == (0, "", f"bake {bake} is already canceled\n")
    assert run("delete", "bake", bake)[2] == (
        f"relume: there is no terminal to ask at; give --yes to delete bake {bake} "
        "(direct, 24×16, 50 lights, views Front)\n"
    )
    assert parsed(run("delete", "bake", bake, "--yes", "--json")[1]) == [{"kind": "bake", "id": bake}]
    assert "no scene" in run("status", bake)[2]
    noted = [(change.what, change.object) for change in open_access(baked).audit.list(2)]
    assert noted == [("delete bake", bake), ("cancel bake", bake)]


JOBS = {
    "render": (
        "render",
        "renders",
        '{"bake":"0123456789abcdef","view":"Front","looks":[{}],"format":"png","frames":3}',
    ),
    "comparison": ("comparison", "comparisons", '{"bake":"0123456789abcdef","view":"Front","look":{},"passes":4}'),
    "btf-job": ("btf", "btf-jobs", '{"name":"Felt","error":0.05}'),
}
LINES = {
    "render": "1 of 3 frames  Front, png",
    "comparison": "1 of 4 passes  Front of bake 0123456789abcdef",
    "btf-job": "1 of 1 steps  Felt",
}


@pytest.mark.parametrize("noun", JOBS)
def test_job_is_listed_canceled_and_deleted_by_its_id(run: Any, tmp_path: Path, noun: str) -> None:
    kind, folder, request = JOBS[noun]
    job = "0" * 15 + "a"
    with closing(BakeService(tmp_path)) as service, service.ledger.sessions.begin() as session:
        session.add(JobRow(id=job, kind=kind, request=request, state="queued", done=1, created=0.0))
    access = open_access(tmp_path)
    access.quotas.assign_owner("Ann", noun, job, 1_000)  # type: ignore[arg-type]
    (tmp_path / folder / job).mkdir(parents=True)
    assert run("list", f"{noun}s", "--state", "ready", data=tmp_path)[:2] == (0, "")
    listed = run("list", f"{noun}s", data=tmp_path)[1]
    assert listed == f"{job}  queued     {LINES[noun]}\n"
    canceled = {"kind": noun, "id": job, "state": "canceled"}
    assert parsed(run("cancel", listed.split()[0], "--json", data=tmp_path)[1]) == [canceled]
    assert run("cancel", job, data=tmp_path) == (0, "", f"{noun} {job} is already canceled\n")
    assert run("delete", noun, job[:8], "--yes", data=tmp_path)[:2] == (0, f"{job}\n")
    assert run("list", f"{noun}s", data=tmp_path)[:2] == (0, "")
    assert not (tmp_path / folder / job).exists()
    assert access.quotas.used_bytes("Ann") == 0
    assert [(change.what, change.object) for change in access.audit.list(2)] == [
        (f"delete {noun}", job),
        (f"cancel {noun}", job),
    ]
    assert f"there is no {noun}" in run("delete", noun, job, "--yes", data=tmp_path)[2]


def test_image_and_material_are_deleted_by_their_listed_names(run: Any, tmp_path: Path) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "red.png")
    store_image(images_path(tmp_path), tmp_path / "red.png", "Red")
    import_btf(btfs_path(tmp_path), zipped(tmp_path / "b.zip"), "Felt", 0.05, lambda share: None, lambda: False)
    for kind, name in (("image", "Red"), ("material", "Felt")):
        listed = run("list", f"{kind}s", data=tmp_path)[1].split()
        assert listed[1:] == [name]
        assert run("delete", kind, listed[0], "--yes", data=tmp_path)[:2] == (0, f"{listed[0]}\n")
        assert run("list", f"{kind}s", data=tmp_path)[:2] == (0, "")


def test_followers_of_a_bake_learn_that_it_is_deleted(tmp_path: Path) -> None:
    with closing(BakeService(tmp_path)) as service:  # runs no bakes
        scene = register_scene(tmp_path, service.ledger, still_life())
        bake = service.submit(scene, Recipe("direct", ("front",), (16, 16), 50))
        with service.subscribe(bake) as changes:
            service.ledger.delete([bake])
            with pytest.raises(NotFoundError, match=f"bake {bake} was deleted"):
                follow(changes, "still life")


def test_finished_bake_cannot_be_canceled(run: Any) -> None:
    code, text, said = run("cancel", "quad one")
    assert (code, text) == (1, "")
    assert "is ready; nothing to cancel" in said


def test_scenes_bakes_and_looks_are_deleted_by_name(tmp_path: Path, run: Any) -> None:
    service = BakeService(tmp_path)
    scene = register_scene(tmp_path, service.ledger, still_life())
    LookStore(service.ledger.sessions).put("Red night", json.dumps(RED), None, None)
    service.close()
    bake = run("bake", "Still_Life", "--size", "16x16", "--lights", "50", "--no-watch", data=tmp_path)[1].strip()
    assert run("list", "bakes", data=tmp_path)[1].startswith(f"{bake}  queued")
    assert run("delete", "look", "red_night", "--yes", data=tmp_path)[1] == "Red night\n"
    assert run("list", "looks", data=tmp_path)[1] == ""
    assert run("delete", "scene", "still life", "--yes", data=tmp_path)[1] == f"{scene}\n"
    assert (run("list", data=tmp_path)[1], run("list", "bakes", data=tmp_path)[1]) == ("", "")
    assert not (tmp_path / "scenes" / scene).exists()
    assert "no scene" in run("cancel", bake, data=tmp_path)[2]
    assert "built-in environments cannot" in run("delete", "environment", "sunset", "--yes", data=tmp_path)[2]


@pytest.mark.parametrize("command", [["list"], ["status"], ["cancel", "x"], ["delete", "look", "x"]])
def test_unused_folder_is_reported(run: Any, tmp_path: Path, command: list[str]) -> None:
    code, _, said = run(*command, data=tmp_path / "typo")
    assert code == 1
    assert "a directory that relume has used" in said


def mean_of(path: Path) -> list[int]:
    return [int(value) for value in np.asarray(Image.open(path))[..., :3].reshape(-1, 3).mean(axis=0)]


def test_many_looks_are_rendered_by_one_command(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "looks"
    folder.mkdir()
    (folder / "a red.json").write_text(json.dumps(RED))
    (folder / "b.json").write_text(json.dumps(BLUE))
    (folder / "notes.txt").write_text("no look")
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(json.dumps([RED, BLUE]).encode())))
    given = [word for look in (str(folder), "red_night", "-") for word in ("--look", look)]
    template = str(tmp_path / "{look}.png")
    code, text, _ = run("render", "quad one", *given, "--output", template)
    assert code == 0
    names = ["a-red", "b", "Red-night", "0000", "0001"]
    assert text.splitlines() == [str(tmp_path / f"{name}.png") for name in names]
    for name, is_red in zip(names, (True, False, True, True, False), strict=True):
        red, _, blue = mean_of(tmp_path / f"{name}.png")
        assert (red > blue) == is_red


def test_resumed_batch_skips_existing_files(run: Any, tmp_path: Path) -> None:
    (tmp_path / "Blue.png").write_bytes(b"there already")
    words = ["--look", "Blue", "--look", "Red night", "--output", str(tmp_path / "{look}.png"), "--json"]
    code, text, _ = run("render", "quad one", *words, "--resume")
    assert code == 0
    assert [picture["look"] for picture in parsed(text)] == ["Blue", "Red night"]
    assert (tmp_path / "Blue.png").read_bytes() == b"there already"
    assert mean_of(tmp_path / "Red-night.png")[0] > 0


def test_dry_run_of_a_render_validates_and_writes_nothing(run: Any, tmp_path: Path) -> None:
    words = ["--look", "Blue", "--output", str(tmp_path / "{look}.exr"), "--dry-run"]
    (document,) = parsed(run("render", "quad one", *words, "--json")[1])
    assert (document["path"], document["look"]) == (str(tmp_path / "Blue.exr"), "Blue")
    assert (document["size"], document["frames"], document["dry_run"]) == ([32, 24], 1, True)
    (tmp_path / "bad.json").write_text('{"materials": {"Nope": {}}}')
    code, _, said = run("render", "quad one", *words, "--look", str(tmp_path / "bad.json"))
    assert code == 1
    assert "look 'bad': /materials is 'Nope'; give a material of this scene: 'White'" in said
    assert [path.name for path in tmp_path.iterdir()] == ["bad.json"]


def test_a_render_that_is_not_waited_for_is_queued_and_followed(run: Any, baked: Path) -> None:
    words = ["--look", "Blue", "--look", "Red night", "--output", "{look}.{frame:04}.exr", "--start", "7", "--aovs"]
    code, text, said = run("render", "quad one", *words, "--no-wait")
    job = text.strip()
    assert code == 0
    assert f"follow it: relume status {job}" in said
    assert str(baked / "renders" / job / "archive.zip") in said
    with closing(BakeService(baked)) as service, service.ledger.sessions() as session:
        row = session.get(JobRow, job)
    assert row is not None
    request = json.loads(row.request)
    assert (row.kind, row.state, request["aovs"]) == ("render", "queued", True)
    assert request["looks"] == [BLUE, RED]
    assert request["file_names"] == ["Blue.0007.exr", "Red-night.0008.exr"]
    assert run("status", job)[1] == f"{job}  queued     0 of 2 frames  {{look}}.{{frame:04}}, exr\n"
    (document,) = parsed(run("status", job, "--json")[1])
    assert (document["id"], document["state"], document["done"], document["total"]) == (job, "queued", 0, 2)
    assert run("cancel", job)[0] == 0


@pytest.fixture
def sets(baked: Path) -> Iterator[None]:
    """Views of the saved looks: "Blue" has the first, "Red night" none."""
    with closing(BakeService(baked)) as service:
        looks = LookStore(service.ledger.sessions)
        looks.put_view("Blue", '{"view": "Front", "camera": null}', "*")
        looks.put("Kitchen", '{"materials": {"Tiles": {"terms": []}}}', None, None)
        looks.put_view("Kitchen", '{"view": "Top", "camera": null}', "*")
        yield
        looks.put_view("Blue", None, "*")
        looks.delete("Kitchen", "*")


@pytest.mark.usefixtures("sets")
def test_sets_are_rendered_each_in_its_view(run: Any, baked: Path, tmp_path: Path) -> None:
    code, text, said = run("render", "quad one", "--all-sets", "--output", str(tmp_path / "{view}_{look}.png"))
    assert "the set 'Kitchen' is not of this scene: Kitchen: /materials is 'Tiles'" in said
    assert (code, text.splitlines()) == (0, [str(tmp_path / "Front_Blue.png")])
    red, _, blue = mean_of(tmp_path / "Front_Blue.png")
    assert blue > red
    words = ["--look", "Red night", "--look", "Blue", "--saved-views", "--output", "{look}.png"]
    job = run("render", "quad one", *words, "--no-wait")[1].strip()
    with closing(BakeService(baked)) as service, service.ledger.sessions() as session:
        row = session.get(JobRow, job)
    assert row is not None
    request = json.loads(row.request)
    assert (request["look_views"], request["file_names"]) == (["Front", "Front"], ["Red-night.png", "Blue.png"])
    assert run("cancel", job)[0] == 0


def test_sets_need_a_view(run: Any) -> None:
    assert "no saved look has a view" in run("render", "quad one", "--all-sets", "--output", "{look}.png")[2]


def test_a_turntable_that_is_not_waited_for_has_its_frames(run: Any, baked: Path) -> None:
    words = ["--turntable", "4", "--rotate", "environment", "--step", "2", "--output", "round"]
    (job,) = parsed(run("render", "quad one", *words, "--no-wait", "--json")[1])
    with closing(BakeService(baked)) as service, service.ledger.sessions() as session:
        row = session.get(JobRow, job["id"])
    assert row is not None
    request = json.loads(row.request)
    assert (job["total"], request["format"]) == (2, "png")
    assert (request["path"]["turntable"], request["path"]["rotate"]) == (4, "environment")
    assert request["file_names"] == ["round.0000.png", "round.0002.png"]
    assert run("cancel", job["id"])[0] == 0


def test_a_dry_run_without_waiting_queues_nothing(run: Any) -> None:
    num_renders = len(run("list", "renders")[1].splitlines())
    assert run("render", "quad one", "--output", "x.png", "--no-wait", "--dry-run")[0] == 0
    assert len(run("list", "renders")[1].splitlines()) == num_renders


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--look", "Blue", "--look", "Red night", "--output", "x.png"], "{look}"),
        (["--all-sets", "--look", "Blue", "--output", "x.png"], "--all-sets is True; give it without --look"),
        (["--saved-views", "--turntable", "2", "--output", "round"], "it without --turntable and --frames"),
        (["--output", "/tmp/x.png", "--no-wait"], "--output is '/tmp/x.png'; give a file name without folders"),
        (["--output", "a b.png", "--no-wait"], "--output is 'a b'; give letters, digits"),
        (["--output", "x.png", "--resume", "--no-wait"], "--resume is True; give it without --no-wait"),
        (["--output", "x.png", "--contact-sheet", "y.png", "--no-wait"], "give it without --no-wait"),
        (["--look", "Blue", "--look", "blue", "--output", "{look}.png"], "images 0 and 1 would both be 'Blue.png'"),
        (["--look", "Blue", "--look", "Red night", "--turntable", "2", "--output", "round"], "look with --turntable"),
        (["--look", "Green", "--output", "x.png"], "folder or saved look; choose from 'Blue', 'Red night'"),
        (["--look", "/no/look.json", "--output", "x.png"], "--look is '/no/look.json'; give a file that exists"),
        (["--output", "x.mp4"], "or --turntable N or --frames N for a video"),
        (["--frames", "9", "--output", "way"], "one look; give two or more looks with --frames"),
        (["--look", "Blue", "--look", "Red night", "--frames", "1", "--output", "way"], "2 to 3,600 frames"),
        (["--look", "Blue", "--look", "Red night", "--frames", "10000000", "--output", "way"], "2 to 3,600 frames"),
        (["--look", "Blue", "--look", "Red night", "--look", "Blue", "--frames", "2", "--output", "way"], "per frame"),
        (["--look", "Blue", "--look", "Red night", "--frames", "4", "--output", "way.png"], "numbered frames"),
        (["--frames", "9", "--turntable", "9", "--output", "way"], "--frames is 9; give it without --turntable"),
        (["--between", "map", "--output", "x.png"], "--between is 'map'; give it with --frames N"),
        (["--rotate", "object", "--output", "x.png"], "--rotate is 'object'; give it with --turntable N"),
        (["--fps", "10", "--output", "x.png"], "--fps is 10; give it with --turntable N"),
        (
            ["--turntable", "2", "--output", "x.png"],
            "a folder for the numbered frames, a name with {frame:04}, or a name ending in .mp4",
        ),
        (
            ["--turntable", "2", "--output", "x.mov"],
            "a folder for the numbered frames, a name with {frame:04}, or a name ending in .mp4",
        ),
        (["--output", "x.{frame:04}.mp4", "--frames", "9"], "without {frame}"),
        (["--output", "{user}.png"], "--output is '{user}'; give the fields {scene}, {bake}, {view}, {look}, {frame}"),
        (["--step", "2", "--output", "x.png"], "--step is 2; give it with --turntable N"),
        (["--view", "front", "--view", "front", "--output", "x.png"], "images 0 and 1 would both be 'x.png'"),
        (["--output", "x.exr", "--contact-sheet", "s.png"], "PNG or WebP files for --contact-sheet"),
        (
            ["--output", "x.png", "--contact-sheet", "s.jpg"],
            "--contact-sheet is 's.jpg'; give a file name ending in .png",
        ),
        (["--output", "x.png", "--contact-sheet", "x.png"], "another name than those of the images"),
        (["--float", "--output", "x.png"], "--output is 'x.png'; give a file name that ends in .exr"),
    ],
)
def test_invalid_render_prints_one_sentence(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, text, error = run("render", "quad one", *words)
    assert (code, text) == (1, "")
    assert said in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_names_have_all_fields_and_a_contact_sheet_all_images(run: Any, tmp_path: Path) -> None:
    words = ["--look", "Blue", "--look", "Red night", "--start", "1001", "--contact-sheet", str(tmp_path / "s.png")]
    output = str(tmp_path / "{scene}_{view}_{look}.{frame:05}.png")
    code, text, _ = run("render", "quad one", *words, "--output", output)
    names = ["Quad-one_Front_Blue.01001.png", "Quad-one_Front_Red-night.01002.png"]
    assert (code, text.split()) == (0, [str(tmp_path / name) for name in names])
    sheet = np.asarray(Image.open(tmp_path / "s.png"))
    assert sheet.shape == (24 + 24 + 2 * 12, 2 * 32 + 3 * 12, 3)
    for x, name in ((12, names[0]), (56, names[1])):
        np.testing.assert_array_equal(sheet[12:36, x : x + 32], np.asarray(Image.open(tmp_path / name)))


def test_several_views_are_rendered_in_one_call(run: Any, tmp_path: Path) -> None:
    to_world = [1, 0, 0, 0.6, 0, 1, 0, 0, 0, 0, 1, 1.5, 0, 0, 0, 1]
    (tmp_path / "side.json").write_text(json.dumps({"name": "Side", "to_world": to_world, "yfov": 45.0}))
    bake = run("bake", "quad one", "--view", "front", "--camera", str(tmp_path / "side.json"), *TINY)[1].strip()
    views = ["--view", "side", "--view", "front"]
    code, text, said = run("render", bake, *views, "--look", "Blue", "--output", str(tmp_path / "{view}.png"))
    assert (code, text.split()) == (0, [str(tmp_path / "Side.png"), str(tmp_path / "Front.png")]), said
    for view in ("Side", "Front"):
        run("render", bake, "--view", view, "--look", "Blue", "--output", str(tmp_path / "one.png"))
        assert (tmp_path / "one.png").read_bytes() == (tmp_path / f"{view}.png").read_bytes()
    assert (tmp_path / "Side.png").read_bytes() != (tmp_path / "Front.png").read_bytes()


def test_frames_of_a_template_may_be_exr_and_skip_steps(run: Any, tmp_path: Path) -> None:
    words = ["--turntable", "4", "--rotate", "environment", "--step", "2", "--start", "7"]
    output = str(tmp_path / "{view}.{frame:03}.exr")
    code, text, said = run("render", "quad one", *words, "--output", output)
    assert (code, text) == (0, f"{tmp_path / 'Front.007.exr'}\n"), said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["Front.007.exr", "Front.009.exr"]
    spec = OpenImageIO.ImageBuf(str(tmp_path / "Front.009.exr")).spec()
    assert json.loads(spec.get_string_attribute("relume:look"))["environment"]["rotation"] == -180
    assert run("render", "quad one", *words, "--output", output)[0] == 1
    assert run("render", "quad one", *words, "--output", output, "--resume")[0] == 0


def test_a_light_mix_is_exported_and_rendered(run: Any, tmp_path: Path) -> None:
    (tmp_path / "dim.json").write_text('{"environment": {"intensity": 0.25}}')
    mix = tmp_path / "mix.json"
    assert run("export", "quad one", str(mix), "--look", str(tmp_path / "dim.json"))[0] == 0
    document = json.loads(mix.read_text())
    assert (document["environment"]["intensity"], document["lights"]) == (0.25, {})
    mix.write_text(json.dumps({**document, "lights": {"Key": {"intensity": 2}}}))
    words = ["--look", str(tmp_path / "dim.json"), "--look", str(mix), "--output", str(tmp_path / "{look}.png")]
    code, _, said = run("render", "quad one", *words)
    assert code == 0
    assert said.count("warning: The light mix has values for lights that the scene does not have: 'Key'.") == 1
    assert (tmp_path / "mix.png").read_bytes() == (tmp_path / "dim.png").read_bytes()


def test_turntable_video_is_written_and_its_path_printed(run: Any, tmp_path: Path) -> None:
    words = ["--turntable", "3", "--rotate", "environment", "--fps", "3"]
    code, text, _ = run("render", "quad one", *words, "--output", str(tmp_path / "x.mp4"))
    assert (code, text) == (0, f"{tmp_path / 'x.mp4'}\n")
    assert (tmp_path / "x.mp4").read_bytes()[4:8] == b"ftyp"
    assert [path.name for path in tmp_path.iterdir()] == ["x.mp4"]  # the frames are removed
    code, text, _ = run("render", "quad one", *words[:4], "--output", str(tmp_path / "round"))
    assert (code, text) == (0, f"{tmp_path / 'round'}\n")
    assert sorted(path.name for path in (tmp_path / "round").iterdir()) == ["0000.png", "0001.png", "0002.png"]


def test_animation_of_looks_is_numbered_resumed_and_ends_at_both(run: Any, tmp_path: Path) -> None:
    words = ["render", "quad one", "--look", "Blue", "--look", "Red night", "--frames", "3", "--between", "map"]
    folder = tmp_path / "way"
    code, text, said = run(*words, "--output", str(folder), "--json")
    assert code == 0, said
    (document,) = parsed(text)
    assert (document["path"], document["look"], document["frames"]) == (str(folder), "Blue to Red night", 3)
    assert sorted(path.name for path in folder.iterdir()) == ["0000.png", "0001.png", "0002.png"]
    for name, frame in (("Blue", 0), ("Red night", 2)):
        assert run("render", "quad one", "--look", name, "--output", str(tmp_path / "end.png"))[0] == 0
        assert (tmp_path / "end.png").read_bytes() == (folder / f"000{frame}.png").read_bytes()
    first, between, last = (mean_of(folder / f"000{k}.png") for k in range(3))
    assert min(first[2], last[2]) < between[2] < max(first[2], last[2])
    assert run(*words, "--output", str(folder))[0] == 1  # there are frames already
    whole = (folder / "0002.png").read_bytes()
    (folder / "0001.png").write_bytes(b"kept")
    (folder / "0002.png").unlink()
    assert run(*words, "--output", str(folder), "--resume")[0] == 0
    assert (folder / "0001.png").read_bytes() == b"kept"
    assert (folder / "0002.png").read_bytes() == whole
    assert run(*words, "--output", str(tmp_path / "way.mp4"))[0] == 0
    assert (tmp_path / "way.mp4").read_bytes()[4:8] == b"ftyp"


def test_quiet_still_prints_results(run: Any, tmp_path: Path) -> None:
    look = tmp_path / "look.json"
    look.write_text('{"environment": {"map": "sunset"}}')
    words = ["render", "quad one", "--look", str(look), "--output", str(tmp_path / "x.png")]
    assert "small light sources are approximate" in run(*words)[2]
    assert run(*words, "--quiet") == (0, f"{tmp_path / 'x.png'}\n", "")


def test_import_prints_its_id_and_a_summary(run: Any, tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl M\nKd .5 0 0\nKs .5 .5 .5\nNs 18\nmap_Bump gone.png\nmap_Ka x.png\n")
    (tmp_path / "t.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 2 0 0\nv 0 1 0\nusemtl M\nf 1 2 3\n")
    code, text, said = run("import", str(tmp_path / "t.obj"), data=tmp_path / "data")
    assert code == 0
    assert len(text.strip()) == 16
    assert "  2 × 1 × 0 m, +Y is up" in said
    assert "  material M: lambert + ggx" in said
    assert [line.partition(":")[0] for line in said.splitlines() if "warning" in line] == [
        "warning, unsupported",
        "warning, approximated",
        "warning, ignored",
    ]
    (scene,) = parsed(run("import", str(tmp_path / "t.obj"), "--json", data=tmp_path / "data")[1])
    assert scene["id"] == text.strip()
    assert {warning["severity"] for warning in scene["warnings"]} == {"unsupported", "approximated", "ignored"}
