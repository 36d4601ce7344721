"""The benchmarks run at a meaningless size, and print their figures in the right form. Times are not asserted."""

import json
import math
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from relume_bench import load, pages, registry, table
from relume_bench.figure import Figure
from relume_bench.machine import measure_stolen_fraction
from relume_bench.measured_code import collect_sources, measured_code
from relume_bench.mitsuba import map_for_mitsuba

FIXED_NAMES = {
    "frame.bandwidth_ratio", "frame.incremental_rmse", "session.edit_to_socket_ms.p50", "session.edit_to_socket_ms.p95",
    "canvas.edit_to_pixels_ms.p50", "canvas.edit_to_pixels_ms.p95", "freeze.curve_switch_s", "accuracy.lambert",
    "accuracy.cook_torrance_0.2", "accuracy.cook_torrance_0.05", "peer.mitsuba_time_ratio", "bake.rays_vs_embreex",
    "bake.wall_vs_rays", "bake.teatray_s", "bake.two_workers_speedup", "bake.ray_saving", "store.bytes_per_view_sample",
}  # fmt: skip
IN_PROCESS = [
    "bandwidth", "incremental", "curve_switch", "accuracy", "swap",
    "rays", "bake", "store_size", "paper_fig5", "accuracy_terms", "accuracy_generated", "pca",
    "turning", "curve_switch_terms", "shade",
    "estimators", "sharp_slider", "mesh_files",
    "factorization", "factorization_measured", "factorization_pictures", "large", "cryptomatte_file",
]  # fmt: skip
LONG = [
    "workers", "plan", "session", "demo", "canvas", "peer_mitsuba", "reference",
    "gather_error", "gather_full", "gather_scenes", "peer_gather", "lights",
    "memory", "gather_interior", "gather_lights", "ray_saving", "gather",
    "gather_incremental", "glass", "roughness_maps", "mirror", "probes", "free_camera_sun",
    "probes_reference", "free_camera_accuracy", "free_camera_correction", "canvas_free_camera", "btf",
    "btf_accuracy", "btf_speed", "load", "btf_edit", "many_sessions", "refusal", "import_clay", "slider_drag",
    "free_camera_exact", "rotation", "btf_several", "btf_moving", "plan_disk", "probes_live", "probes_error", "assets",
    "export_round_trip", "export_blender", "light_groups", "lens",
    "opening", "flood", "slow_readers", "room_join", "render_workers", "scaling.simulation", "scaling.unit_costs",
    "sharp", "sharp_room", "sharp_checker", "sharp_maps", "sharp_free_camera", "sharp_edits", "setup_kernels", "solve",
]  # fmt: skip
# figures from random points or a noisy renderer have a standard error
ESTIMATES = (
    "accuracy.",
    "paper.",
    "reference.",
    "gather.rmse_",
    "gather.full_",
    "glass.",
    "roughness.",
    "mirror.",
    "sharp.rmse_",
    "sharp.static_rmse_",
    "sharp.moving_rmse_",
    "lights.rmse_",
    "estimators.",
    "peer.",
    "probes.rmse_",
    "probes.probe_rmse",
    "btf.geometry_rmse",
    "btf.moving_rmse",
    "btf.sphere_rmse",
)


def groups_of(module: str) -> list[registry.Group]:
    return [group for group in registry.GROUPS if group.module == f"relume_bench.{module}"]


def check(group: registry.Group) -> None:
    with ThreadPoolExecutor(1) as pool:  # the main thread may have the event loop of a browser
        figures = pool.submit(group.measure, tiny=True).result()
    assert [figure.name for figure in figures] == list(group.names)
    for figure in figures:
        assert "failed" not in figure.context, figure.context
        if figure.value is None:
            assert figure.context["skipped"]
        else:
            assert math.isfinite(figure.value)
            assert figure.value >= 0 or "bias" in figure.name
            assert figure.unit
            assert (figure.standard_error is not None) == figure.name.startswith(ESTIMATES), figure.name
            assert figure.standard_error is None or figure.standard_error > 0
        assert figure.context


def test_names_are_those_that_scripts_use() -> None:
    assert set(registry.names()) >= FIXED_NAMES
    assert len(registry.names()) == len(set(registry.names()))
    assert {group.module for group in registry.GROUPS} == {f"relume_bench.{name}" for name in (*IN_PROCESS, *LONG)}


@pytest.mark.parametrize("module", IN_PROCESS)
def test_benchmark_runs_small(module: str) -> None:
    for group in groups_of(module):
        check(group)


@pytest.mark.slow
@pytest.mark.parametrize("module", LONG)
def test_long_benchmark_runs_small(module: str) -> None:
    for group in groups_of(module):
        check(group)


def test_stolen_fraction_is_relative_to_the_requested_time() -> None:
    assert measure_stolen_fraction((1000, 10), (1200, 60)) == 0.25
    assert measure_stolen_fraction((1000, 10), (1000, 10)) is None
    assert measure_stolen_fraction(None, (1, 1)) is None


def test_json_is_a_list_of_figures(capsys: pytest.CaptureFixture[str]) -> None:
    assert registry.run("frame.bandwidth", as_json=True, tiny=True) == 0
    (figure,) = json.loads(capsys.readouterr().out)
    assert set(figure) == {"name", "value", "unit", "context", "standard_error"}
    assert figure["standard_error"] is None
    assert figure["name"] == "frame.bandwidth_ratio"
    assert figure["context"]["threads"] >= 1


def test_unknown_name_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert registry.run("nothing", as_json=True) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(r"relume: no benchmark starts with 'nothing'.*frame\.bandwidth_ratio.*\n", said.err)


def test_failure_is_a_figure_and_the_others_continue(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = registry.Group("nowhere", ("frame.broken",))
    monkeypatch.setattr(registry, "GROUPS", (broken, *groups_of("bandwidth")))
    assert registry.run("frame", as_json=True, tiny=True) == 1
    first, second = json.loads(capsys.readouterr().out)
    assert first["value"] is None
    assert "nowhere" in first["context"]["failed"]
    assert second["value"] > 0


def test_merge_preserves_figures_that_were_not_measured() -> None:
    text = f"before\n{table.BEGIN}\n{table.END}\nafter\n"
    details = {"size": [640, 480], "measured_on": "2026-11-28, schema 8"}
    first_figure = {"name": "bake.nothing_s", "value": 12.345, "unit": "s", "context": details}
    second_figure = {"name": "accuracy.lambert", "value": 0.00412, "unit": "relative RMSE", "context": {}}
    merged = table.merge([first_figure], [second_figure])
    assert merged == [second_figure, first_figure]
    assert table.merge(merged, [second_figure]) == merged
    page = table.filled(text, merged)
    assert "| `bake.nothing_s` | 12.3 s |  |  | 2026-11-28 |" in page.splitlines()
    assert "| `accuracy.lambert` | 0.41 % | ≤ 0.5 % | reference, every texel |  |" in page.splitlines()
    assert table.filled(page, merged) == page
    assert page.startswith("before\n")
    assert page.endswith("\nafter\n")


@pytest.mark.parametrize("name", pages.PAGES)
def test_pages_describe_every_figure(name: str) -> None:
    text = (pages.DOCS / f"{name}.md").read_text()
    for figure in (figure for figure in registry.names() if pages.find_document(figure) == name):
        assert figure.removesuffix(".p50").removesuffix(".p95") in text


def test_estimate_is_shown_with_its_standard_error() -> None:
    share = {"name": "gather.rmse_x", "value": 0.0112, "unit": "relative RMSE", "context": {}, "standard_error": 0.0034}
    assert table.row(share) == "| `gather.rmse_x` | 1.12 ± 0.34 % |  | Mitsuba 3 |  |"
    ratio = {"name": "peer.x", "value": 1.2e6, "unit": "ratio", "context": {}, "standard_error": 9.8e4}
    assert "| 1.2e+06 ± 9.8e+04 × |" in table.row(ratio)


@pytest.mark.parametrize("name", pages.PAGES)
def test_tables_show_the_stored_figures(name: str) -> None:
    figures = json.loads((pages.DOCS / f"{name}.json").read_text())
    text = (pages.DOCS / f"{name}.md").read_text()
    assert table.filled(text, figures) == text.replace(table.OLDER, "")  # what is older changes with each commit
    assert {figure["name"] for figure in figures} <= set(registry.names())


@pytest.mark.parametrize("name", pages.PAGES)
def test_rows_are_those_that_the_benchmarks_wrote(name: str) -> None:
    """A row has what `Group.measure` adds to every figure; the hash of the code since there is one."""
    for figure in json.loads((pages.DOCS / f"{name}.json").read_text()):
        context = figure["context"]
        assert {"measured_in_s", "stolen_share", "measured_on"} <= set(context), figure["name"]
        assert re.fullmatch(r"\d{4}-\d\d-\d\d, schema \d+", context["measured_on"]), figure["name"]
        if context["measured_on"] > "2026-11-30":
            assert re.fullmatch(r"[0-9a-f]{16}", context["code"]), figure["name"]


def test_figures_older_than_their_code_are_listed_and_marked() -> None:
    (group,) = groups_of("bandwidth")
    (new,) = group.names
    stored = {
        name: {
            "name": name,
            "value": 1.0,
            "unit": "s",
            "context": {"measured_on": "2026-12-01, schema 8", "code": code},
        }
        for name, code in ((new, measured_code(group.module)), ("shade.vs_operator_sums", "0" * 16))
    }
    older = registry.find_older(stored)
    assert set(registry.names()) - set(older) == {new}  # the others have other code, or no row
    page = table.filled(f"{table.BEGIN}\n{table.END}", list(stored.values()), older)
    assert [line.endswith(f"{table.OLDER} |") for line in page.splitlines() if "| `" in line] == [False, True]


def test_code_of_a_figure_is_that_of_all_imports() -> None:
    codes = {group.module: measured_code(group.module) for group in registry.GROUPS}
    assert len(set(codes.values())) == len(codes)
    names = {f"{path.parent.name}/{path.stem}" for path in collect_sources(Path(load.__file__))}
    assert {"relume_bench/load", "relume_bench/baked_server", "store/bake_protocol"} <= names
    assert "relume_bench/glass" not in names


def test_figure_without_a_value_has_a_reason() -> None:
    assert "not measured" in table.row({"name": "x", "value": None, "unit": "s", "context": {"skipped": "no browser"}})
    assert Figure("x", None, "s").context == {}


@pytest.mark.parametrize("num_rows", [6, 500, 2048])
def test_mitsuba_reads_map_rows_at_their_elevations(num_rows: int) -> None:
    """Mitsuba interpolates between rows at the ends of [0, π]; the centers of our rows keep their values."""
    radiance = np.random.default_rng(1).random((num_rows, 3, 3)).astype(np.float32)
    handed = map_for_mitsuba(radiance)
    finer = handed.shape[1] // 3
    places = np.linspace(0, 1, len(handed))
    middles = (np.arange(num_rows) + 0.5) / num_rows
    for column in range(3):
        read = np.interp(middles, places, handed[:, finer * column + finer // 2, 0])
        np.testing.assert_allclose(read, radiance[:, column, 0], rtol=1e-5)
