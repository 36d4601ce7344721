"""The `relume` command: its output, its errors and Ctrl-C, with real bakes of a tiny scene."""

import json
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from PIL import Image

from relume.assets.environments.environment import Environment
from relume.scene.examples.catalog import BUILT_IN, built_in
from relume.scene.model import Camera, Material, Mesh
from relume.scene.scene_folder import make_scene
from relume_cli import background
from relume_cli.bake import _interrupted
from relume_cli.interrupts import capture_interrupts
from relume_cli.main import main
from relume_server.settings import Settings
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene
from relume_worker.status import BakeStatus

RELUME = [sys.executable, "-m", "relume_cli.main"]
TINY = ["--method", "direct", "--size", "32x24", "--lights", "100"]


def open_ledger(data: Path) -> Ledger:
    return Ledger(open_database(f"sqlite:///{data / 'relume.db'}"))


def only_bake(data: Path) -> BakeStatus:
    ledger = open_ledger(data)
    (status,) = ledger.bakes()
    ledger.close()
    return status


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder with the scene "quad": a white square that fills the picture."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (4, 1))
    zeros = np.zeros((4, 4), np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    mesh = Mesh("quad", positions, normals, zeros, zeros[:, :2].copy(), faces, 0)
    camera = np.eye(4)
    camera[2, 3] = 1.5
    material = Material("White", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
    light = Environment("white", np.ones((16, 32, 3), np.float32))
    scene = make_scene("quad", [mesh], [material], [Camera("front", camera, 0.8), Camera("back", camera, 0.9)], light)
    folder = tmp_path / "data"
    folder.mkdir()
    ledger = open_ledger(folder)
    register_scene(folder, ledger, scene)
    ledger.close()
    monkeypatch.setenv("RELUME_DATA", str(folder))
    return folder


def test_help_imports_no_heavy_modules() -> None:
    script = (
        "import sys; from relume_cli.main import main; main(['--help']); "
        "heavy = {'numpy', 'zarr', 'numba', 'fastapi', 'distributed', 'sqlalchemy'} & set(sys.modules); "
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for command in [
        "demo",
        "import",
        "list",
        "bake",
        "status",
        "cancel",
        "render",
        "delete",
        "serve",
        "worker",
        "backup",
        "restore",
        "reference",
        "bench",
        "audit",
    ]:
        assert re.search(rf"^  {command} ", done.stdout, re.MULTILINE)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_scenes_are_imported_by_name(data: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["import", "--built-in", name]) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == built_in(name).id
    assert "warning" not in said.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nonsense"], "nonsense"),
        (["bake"], "SCENE"),
        (["bake", "nowhere"], "no scene 'nowhere'"),
        (["bake", "../../etc"], "no scene"),
        (["bake", "quad", "--size", "0x9"], "640x480"),
        (["bake", "quad", "--size", "99999x99999"], "pixels"),
        (["bake", "quad", "--lights", "0"], "at least 1"),
        (["bake", "quad", "--lights", "many"], "--lights is 'many'; give a whole number"),
        (["bake", "quad", "--lights=many"], "--lights is 'many'; give a whole number"),
        (["bake", "quad", "--method", "direct", "--gather-rays", "100"], "direct"),
        (["bake", "quad", "--method", "gather", "--gather-rays", "9"], "16 to 4,096"),
        (["bake", "quad", "--method", "probes", "--patches", "9"], "64 to"),
        (["bake", "quad", "--method", "magic"], "--method is 'magic'; give one of 'direct', 'gather', 'probes'"),
        (["bake", "quad", "--preset", "best"], "--preset is 'best'; give one of 'preview', 'good', 'final'"),
        (["bake", "quad", "--view", "top"], "--view is 'top'; give some of front"),
        (["import", "/no/such-file.glb"], "FILE is '/no/such-file.glb'; give a file that exists"),
        (["import", "a.glb", "--environment", "/no/sky.hdr"], "--environment is '/no/sky.hdr'; give a file"),
        (["import"], "there is nothing to import; give a scene file, or --built-in NAME"),
        (["import", "--built-in", "nowhere"], "cornell_box"),
        (["import", "--built-in", "interior", "--name", "mine"], "alone"),
        (["reference", "nowhere", "--spp", "4", "--output", "x.exr"], "no scene"),
        (["reference", "quad", "--spp", "0", "--output", "x.exr"], "--spp is 0; give a number from 1 to "),
        (["worker", "--scheduler", "nonsense"], "tcp://"),
        (["serve", "--port", "0"], "--port is 0; give a number from 1 to 65535"),
        (["serve", "--data", "postgresql://ann:secret@db/relume"], "RELUME_DATABASE"),
        (["worker", "--data", "sqlite:////tmp/relume.db"], "RELUME_DATABASE"),
        (["serve", "--host", "0.0.0.0"], "RELUME_LOGIN=true"),
    ],
)
def test_failure_is_one_line_on_stderr(
    data: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert main(arguments) != 0
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert err.startswith("relume: ")
    assert words in err
    assert "Traceback" not in err
    assert "secret" not in err


def test_summaries_are_never_truncated(capsys: pytest.CaptureFixture[str]) -> None:
    for group in ([], ["token"], ["material"], ["environment"], ["db"]):
        assert main([*group, "--help"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line for line in lines if line.endswith("...") and "Usage" not in line] == []


def test_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{version('relume')}\n"


def test_verbose_shows_the_traceback(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", "nowhere", "--verbose"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_bake_prints_its_id_every_time(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", "quad", "--view", "front", *TINY]) == 0
    first = capsys.readouterr().out
    status = only_bake(data)
    assert (first, status.state, status.recipe.views) == (f"{status.id}\n", "ready", ("front",))
    assert (data / "bakes" / f"{status.id}.zarr" / "manifest.json").exists()
    assert main(["bake", status.scene[:6], "--view", "front", *TINY]) == 0
    assert capsys.readouterr().out == first


def test_bake_without_watch_stays_queued(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", "quad", "--no-watch", *TINY]) == 0
    assert capsys.readouterr().out == f"{only_bake(data).id}\n"
    assert only_bake(data).state == "queued"


def test_ambiguous_scene_names_are_rejected(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from relume_worker.database.models import SceneRow

    ledger = open_ledger(data)
    with ledger.sessions.begin() as session:
        empty = json.dumps({"views": [], "materials": [], "warnings": [], "num_triangles": 0})
        session.add(SceneRow(id="f" * 16, name="quad", created=0.0, summary=empty))
    ledger.close()
    assert main(["bake", "quad", *TINY]) == 1
    assert "f" * 16 in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 5000])
def test_look_that_is_not_an_object_is_rejected(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    (tmp_path / "look.json").write_text(text)
    output = tmp_path / "x.png"
    assert main(["render", "quad", "--look", str(tmp_path / "look.json"), "--output", str(output)]) == 1
    assert "--look" in capsys.readouterr().err
    assert not output.exists()


def test_render_writes_the_expected_radiance(data: Path, tmp_path: Path) -> None:
    import OpenImageIO

    assert main(["bake", "quad", "--view", "front", *TINY]) == 0
    look = tmp_path / "look.json"
    look.write_text(json.dumps({"materials": {"White": {"terms": [{"model": "lambert", "color": [0.5, 0.25, 1.0]}]}}}))
    assert main(["render", "quad", "--look", str(look), "--output", str(tmp_path / "x.exr")]) == 0
    pixels = OpenImageIO.ImageBuf(str(tmp_path / "x.exr")).get_pixels(OpenImageIO.FLOAT)
    assert pixels.shape[:2] == (24, 32)
    # white light from everywhere on a flat open surface: radiance is the albedo
    np.testing.assert_allclose(pixels[12, 16, :3], [0.5, 0.25, 1.0], rtol=0.02)


def test_render_takes_a_bake_by_its_id(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for size in ("32x24", "16x16"):
        assert main(["bake", "quad", "--view", "front", "--method", "direct", "--size", size, "--lights", "10"]) == 0
    fine, coarse = capsys.readouterr().out.split()
    for name, width in ((coarse, 16), (coarse[:12], 16), (fine, 32), ("quad", 32)):
        assert main(["render", name, "--output", str(tmp_path / "x.png")]) == 0
        assert np.asarray(Image.open(tmp_path / "x.png")).shape[1] == width
    for more, output, words in (
        ([coarse, "--view", "top"], "y.png", "its views are front"),
        ([coarse, "--turntable", "2"], "round", "--method probes"),
        (["0123456789ab"], "y.png", "no scene"),
    ):
        assert main(["render", *more, "--output", str(tmp_path / output)]) == 1
        assert words in capsys.readouterr().err


def test_render_writes_layers_and_rejects_formats_without_them(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import OpenImageIO

    assert main(["bake", "quad", "--view", "front", *TINY]) == 0
    look, output = tmp_path / "look.json", tmp_path / "x.exr"
    look.write_text(json.dumps({"lights": {"Key": {"kind": "point", "position": [0, 0, 2]}}}))
    assert main(["render", "quad", "--look", str(look), "--layers", "--output", str(output)]) == 0
    spec = OpenImageIO.ImageBuf(str(output)).spec()
    layers = ("light_Key", "light_environment")
    assert set(spec.channelnames) == {"R", "G", "B", *(f"{name}.{c}" for name in layers for c in "RGB")}
    assert str(spec.format) == "half"
    assert json.loads(spec.get_string_attribute("relume:sceneName")) == "quad"
    assert main(["render", "quad", "--look", str(look), "--light-groups", "--output", str(output)]) == 0
    image = OpenImageIO.ImageBuf(str(output))
    assert set(image.spec().channelnames) == {"R", "G", "B", *(f"{n}_direct.{c}" for n in layers for c in "RGB")}
    red = dict(zip(image.spec().channelnames, np.moveaxis(image.get_pixels(OpenImageIO.FLOAT), 2, 0), strict=True))
    np.testing.assert_allclose(sum(red[f"{name}_direct.R"] for name in layers), red["R"], rtol=2e-3)
    assert main(["render", "quad", "--layers", "--light-groups", "--output", str(output)]) == 1
    assert "--light-groups" in capsys.readouterr().err
    assert main(["render", "quad", "--aovs", "--output", str(output)]) == 0
    spec = OpenImageIO.ImageBuf(str(output)).spec()
    types = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    assert {types[name] for name in ("R", "G", "B")} == {"half"}
    assert {types[name] for name in ("Z", "P.X", "N.Z", "albedo.G", "CryptoObject02.A")} == {"float"}
    assert main(["render", "quad", "--aovs", "--output", str(tmp_path / "x.png")]) == 1
    assert "--aovs" in capsys.readouterr().err
    assert main(["render", "quad", "--float", "--output", str(output)]) == 0
    assert str(OpenImageIO.ImageBuf(str(output)).spec().format) == "float"
    assert main(["render", "quad", "--layers", "--output", str(tmp_path / "x.png")]) == 1
    assert ".exr" in capsys.readouterr().err


def test_turntable_writes_numbered_frames_and_resumes(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, look = tmp_path / "round", tmp_path / "look.json"
    look.write_text(json.dumps({"materials": {"White": {"terms": [{"model": "lambert", "color": [0.5, 0.25, 1.0]}]}}}))
    turntable = ["render", "quad", "--turntable", "3", "--look", str(look), "--output", str(folder)]
    assert main(turntable) == 1
    assert "--method probes" in capsys.readouterr().err
    assert main(["bake", "quad", "--view", "front", "--probes", "200", *TINY]) == 1
    assert "method direct has no probes" in capsys.readouterr().err
    assert main(["bake", "quad", "--view", "front", *TINY, "--method", "probes", "--probes", "200"]) == 0
    assert main(turntable) == 0
    frames = [np.asarray(Image.open(folder / f"{k:04d}.png")) for k in range(3)]
    assert frames[0].shape == (24, 32, 3)
    assert (frames[0] != frames[1]).any()
    assert main(turntable) == 1
    assert "--resume" in capsys.readouterr().err
    (folder / "0001.png").unlink()
    (folder / "0002.png").write_bytes(b"kept")
    assert main([*turntable, "--resume"]) == 0
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "0001.png")), frames[1])
    assert (folder / "0002.png").read_bytes() == b"kept"
    assert main(["render", "quad", "--approximate", "--output", str(tmp_path / "x.png")]) == 0
    assert "approximate" in capsys.readouterr().err
    turned = tmp_path / "turned"
    assert main(["render", "quad", "--turntable", "2", "--rotate", "environment", "--output", str(turned)]) == 0
    assert len(list(turned.glob("*.png"))) == 2
    assert main(["render", "quad", "--turntable", "0", "--output", str(tmp_path / "none")]) == 1


def test_server_with_a_damaged_database_prints_one_sentence(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (data / "relume.db").write_bytes(bytes(range(256)) * 64)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = str(probe.getsockname()[1])
    assert main(["serve", "--data", str(data), "--port", port]) == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "listens" not in line]
    assert line.startswith("relume: the database is damaged")


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("RELUME_FAIR_SHARES", "{bad", "RELUME_FAIR_SHARES is '{bad'; give JSON"),
        ("RELUME_FAIR_SHARES", '{"Ann": -1}', "RELUME_FAIR_SHARES.Ann is -1; give more than 0"),
        ("RELUME_TRUSTED_PROXIES", '["10.0.0.300"]', "RELUME_TRUSTED_PROXIES.0 is '10.0.0.300'; give an address"),
        ("RELUME_LOG_LEVEL", "loud", "RELUME_LOG_LEVEL is 'loud'; give 'debug', 'info', "),
        ("RELUME_STORAGE", "s3://", "RELUME_STORAGE is 's3://'; give a URL that works (Generic URL error: "),
        ("RELUME_STORAGE", "ftp://x", "RELUME_STORAGE is 'ftp://x'; give a URL such as s3://bucket/prefix"),
        ("RELUME_DATABASE", "postgresql://ann@127.0.0.1:9/x", "the database cannot be used (network error: "),
    ],
)
def test_invalid_setting_prints_one_sentence(
    data: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    variable: str,
    value: str,
    said: str,
) -> None:
    monkeypatch.setenv(variable, value)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = str(probe.getsockname()[1])
    assert main(["serve", "--data", str(data), "--port", port]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"relume: {said}")


def test_files_of_a_server_are_private_to_its_user(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    masks: list[int] = []

    def record(*_: object, **__: object) -> None:
        masks.append(os.umask(0o077))

    monkeypatch.setattr("relume_server.app.serve", record)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = str(probe.getsockname()[1])
    before = os.umask(0o022)
    try:
        assert main(["serve", "--data", str(data), "--port", port]) == 0
        assert os.umask(0o022) == 0o022
    finally:
        os.umask(before)
    assert masks == [0o077]


def test_port_in_use_is_reported(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["serve", "--port", port]) == 1
    err = capsys.readouterr().err
    assert port in err
    assert len(err.splitlines()) == 1


def hear_interrupts() -> None:
    """Tests that run in the background of a script, and the processes they start, ignore SIGINT; restore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


LONG = [
    "bake",
    "quad",
    "--method",
    "direct",
    "--size",
    "320x240",
    "--lights",
    "200",
]  # long enough for a cluster to start


def wait_for_state(data: Path, state: str) -> None:
    """Wait until the only bake reaches this state; on a busy machine this may take minutes."""
    end = time.monotonic() + 300
    states: list[str] = []
    while time.monotonic() < end:
        ledger = open_ledger(data)
        states = [status.state for status in ledger.bakes()]
        ledger.close()
        if states == [state]:
            return
        time.sleep(0.05)
    pytest.fail(f"the bake is {states}, not {state}")


def test_interrupt_is_recorded_and_not_raised_elsewhere() -> None:
    with capture_interrupts() as asked:
        assert not asked.is_set()
        os.kill(os.getpid(), signal.SIGINT)
        assert asked.wait(60)


@pytest.mark.slow
def test_interrupt_without_a_terminal_cancels_and_the_same_command_resumes(data: Path) -> None:
    process = subprocess.Popen(
        [*RELUME, *LONG], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=hear_interrupts
    )
    wait_for_state(data, "running")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "canceled; finished tasks are saved" in err
    assert "Traceback" not in err
    assert only_bake(data).state == "canceled"
    again = subprocess.run([*RELUME, *LONG], capture_output=True, check=False, text=True)
    assert again.returncode == 0, again.stderr
    assert only_bake(data).state == "ready"


def test_background_bake_has_no_password_in_its_arguments(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: dict[str, Any] = {}
    monkeypatch.setattr(
        "relume_cli.bake.subprocess.Popen", lambda arguments, **more: begun.update(more, arguments=arguments)
    )
    monkeypatch.setattr("relume_cli.bake.sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("relume_cli.bake.typer.confirm", lambda *_, **__: True)
    settings = Settings(data=data, database="postgresql://ann:secret@db/relume")
    assert _interrupted(MagicMock(), settings, "0123456789abcdef") == 0
    assert "secret" not in " ".join(begun["arguments"])
    assert begun["env"]["RELUME_DATABASE"] == settings.database
    monkeypatch.setattr("relume_cli.background.BakeService", MagicMock(side_effect=[RuntimeError("begun")]))
    monkeypatch.setattr("sys.argv", begun["arguments"][2:])
    monkeypatch.setenv("RELUME_DATABASE", begun["env"]["RELUME_DATABASE"])
    before = os.umask(0o022)
    try:
        with pytest.raises(RuntimeError, match="begun"):
            background.main()
    finally:
        os.umask(before)
    background.BakeService.assert_called_once_with(data, settings.database, None)


@pytest.mark.slow
def test_interrupt_at_a_terminal_asks_and_can_leave_the_bake_running(data: Path) -> None:
    controller, terminal = pty.openpty()
    process = subprocess.Popen(
        [*RELUME, *LONG], stdin=terminal, stdout=terminal, stderr=terminal, process_group=0, preexec_fn=hear_interrupts
    )
    os.close(terminal)
    wait_for_state(data, "running")
    process.send_signal(signal.SIGINT)
    shown = b""
    while b"background?" not in shown:
        shown += os.read(controller, 4096)
    os.write(controller, b"y\n")
    assert process.wait(timeout=60) == 0
    assert only_bake(data).state in ("running", "ready")
    wait_for_state(data, "ready")
    os.close(controller)
