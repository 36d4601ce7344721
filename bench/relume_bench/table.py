"""Merge figures into docs/performance.json and docs/accuracy.json, and write the tables of both pages from them.

`relume bench --json | python -m relume_bench.table`. A file has the list that `relume bench --json` prints, with the
context of each figure; figures that a run did not measure keep their entries. Tables are between two marks.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from relume_bench import asset_table

# an installed package has no pages
DOCS = next((folder for folder in Path(__file__).resolve().parents if (folder / "docs").is_dir()), Path()) / "docs"
BEGIN, END = "<!-- figures, written by relume_bench.table -->", "<!-- end of figures -->"
HEAD = ["| figure | value | target | limit or peer | date |", "|---|---|---|---|---|"]
PAGES = ("performance", "accuracy")
OLDER = " \\*"  # behind the date of a figure that is older than its code

TARGETS = {
    "frame.bandwidth_ratio": "≥ 0.8",
    "frame.incremental_rmse": "≤ 1e-4",
    "freeze.curve_switch_s": "≤ 0.3 s",
    "freeze.terms_s": "≤ 0.8 s",
    "shade.pairs_per_s_vs_limit": "≥ 0.3",
    "session.edit_to_socket_ms.p50": "≤ 10 ms",
    "session.edit_to_socket_ms.p95": "≤ 20 ms",
    "load.drag_with_renders_ratio": "≥ 0.7",
    "scaling.cpu_prediction": "0.5 to 2",
    "scaling.calls_prediction": "0.7 to 1.4",
    "scaling.farm_calls_prediction": "0.7 to 1.4",
    "scaling.fairness": "≥ 0.7",
    "scaling.lock_errors": "≤ 0",
    "load.aggregate_ratio": "≥ 0.9",
    "canvas.edit_to_pixels_ms.p50": "≤ 16 ms",
    "canvas.edit_to_pixels_ms.p95": "≤ 33 ms",
    "accuracy.lambert": "≤ 0.5 %",
    "accuracy.cook_torrance_0.2": "≤ 0.8 %",
    "accuracy.cook_torrance_0.05": "≤ 4 %",
    "accuracy.generated_lambert": "≤ 0.1 %",
    "accuracy.generated_cook_torrance_0.2": "≤ 0.8 %",
    "accuracy.generated_cook_torrance_0.05": "≤ 4 %",
    "paper.fig5_incremental": "≤ 1e-5",
    "pca.blinn_phong_6": "≤ 1e-3",
    "pca.vectors": "≤ 12",
    "peer.mitsuba_time_ratio": "≥ 1000",
    "peer.mitsuba_gather_time_ratio": "≥ 1000",
    "peer.cycles_time_ratio": "≥ 1000",
    "bake.rays_vs_embreex": "≥ 3",
    "bake.wall_vs_rays": "≤ 1.3",
    "bake.teatray_s": "≤ 15 s",
    "bake.ray_saving": "≥ 3",
    "bake.two_workers_speedup": "≥ 1.8",
    "render.two_workers_speedup": "≥ 1.7",
    "store.bytes_per_view_sample": "≤ 600",
    "export.cryptomatte_error": "≤ 0.39 %",
    "import.clay_s": "≤ 3 s",
    "assets.rmse_median": "≤ 4 %",
    "assets.rmse_p90": "≤ 12 %",
    "assets.flip_median": "≤ 0.03",
    "assets.flip_p90": "≤ 0.08",
    "export.glb_rmse": "≤ 1 %",
    "export.errors": "≤ 0",
    "export.blender_error": "≤ 1 %",
    "mirror.rmse": "≤ 10 %",
    "mirror.sharp_rmse": "≤ 5 %",
    "sharp.rmse_0.02": "≤ 4 %",
    "sharp.rmse_0.05": "≤ 4 %",
    "sharp.rmse_0.1": "≤ 4 %",
    "sharp.rmse_0.2": "≤ 3 %",
    "sharp.rmse_0.3": "≤ 3 %",
    "sharp.rmse_plastic_0.05": "≤ 3 %",
    "sharp.rmse_plastic_0.1": "≤ 3 %",
    "sharp.rmse_checker": "≤ 3 %",
    "sharp.rmse_room": "≤ 5 %",
    "sharp.speckle_0.02": "≤ 1.3",
    "sharp.speckle_0.05": "≤ 1.3",
    "sharp.speckle_0.1": "≤ 1.3",
    "sharp.speckle_0.2": "≤ 1.3",
    "sharp.speckle_0.3": "≤ 1.3",
    "sharp.static_rmse_0.02": "≤ 5 %",
    "sharp.static_rmse_0.05": "≤ 5 %",
    "sharp.static_rmse_0.1": "≤ 5 %",
    "sharp.static_rmse_0.2": "≤ 4 %",
    "sharp.static_rmse_0.3": "≤ 4 %",
    "sharp.moving_rmse_0.02": "≤ 15 %",
    "sharp.moving_rmse_0.05": "≤ 12 %",
    "sharp.moving_rmse_0.1": "≤ 10 %",
    "sharp.moving_rmse_0.2": "≤ 8 %",
    "sharp.moving_rmse_0.3": "≤ 8 %",
    "sharp.clean_s": "≤ 1 s",
    "sharp.drag_fps": "≥ 15",
    "gather.bake_s": "≤ 4 s",
    "probes.bake_s": "≤ 60 s",
    "probes.bytes_per_probe": "≤ 1000",
    "probes.view_fps": "≥ 15",
    "probes.canvas_fps": "≥ 15",
    "btf.compression_error": "≤ 2 %",
    "btf.compression_flat_error": "≤ 2 %",
    "btf.compression_s": "≤ 300 s",
    "btf.geometry_rmse": "≤ 5 %",
    "btf.moving_rmse": "≤ 6 %",
    "btf.table_rmse": "≤ 2 %",
    "btf.view_fps": "≥ 24",
    "btf.light_ms": "≤ 80 ms",
    "btf.light_bytes": "≤ 50 kB",
    "free_camera.rmse_median": "≤ 6 %",
    "free_camera.rmse_worst": "≤ 12 %",
    "free_camera.blots": "≤ 0.2 %",
    "free_camera.exact_s_cornell": "≤ 1.5 s",
    "free_camera.exact_s_still_life": "≤ 5 s",
    "free_camera.exact_s_interior": "≤ 5 s",
    "free_camera.view_vs_sun": "≥ 1",
    "free_camera.brdf_vs_sun": "≥ 3",
    "free_camera.all_vs_sun": "≥ 3",
    "free_camera.light_age_ms_13k": "≤ 60 ms",
    "free_camera.light_age_ms_36k": "≤ 100 ms",
    "free_camera.light_age_ms_62k": "≤ 150 ms",
    "probes.rmse_diffuse": "≤ 3 %",
    "probes.rmse_hard_sun": "≤ 8 %",
    "probes.rmse_glossy_0.5": "≤ 6 %",
    "probes.rmse_glossy_0.3": "≤ 12 %",
    "probes.rmse_ggx_0.5": "≤ 6 %",
    "probes.rmse_ggx_0.3": "≤ 12 %",
    "probes.probe_rmse": "≤ 1 %",
    "probes.first_edit_s": "≤ 1 s",
    "probes.incremental_error": "≤ 10 %",
    "probes.correction_s": "≤ 1 s",
    "free_camera.correction_ratio": "≤ 1",
    "factorization.phong_terms_per_exponent": "2.5",
    "gather.store_mb": "≤ 116 MB",
    "gather.freeze_s": "≤ 0.5 s",
    "gather.brdf_fps": "≥ 60",
    "gather.interior_bake_s": "≤ 15 s",
    "gather.interior_store_mb": "≤ 1390 MB",
    "gather.light_move_fps": "≥ 20",
    "gather.area_light_move_fps": "≥ 20",
    "gather.light_intensity_fps": "≥ 60",
    "gather.rmse_diffuse": "≤ 2 %",
    "gather.rmse_glossy": "≤ 5 %",
    "gather.full_rmse_cornell_box": "≤ 8 %",
    "gather.full_rmse_tableau": "≤ 8 %",
    "gather.full_rmse_still_life": "≤ 12 %",
    "gather.full_rmse_interior": "≤ 4 %",
    "gather.full_bias_cornell_box": "± 2 %",
    "gather.full_bias_tableau": "± 2 %",
    "gather.full_bias_still_life": "± 2 %",
    "gather.full_bias_interior": "± 2 %",
    "lights.rmse_point": "≤ 2 %",
    "lights.rmse_rectangle": "≤ 2 %",
    "lights.intensity_fps": "≥ 60",
    "opening.first_s": "≤ 1 s",
    "opening.exact_s": "≤ 1 s",
    "opening.exact_gather_s": "≤ 2 s",
    "opening.prewarmed_s": "≤ 1 s",
    "opening.prewarmed_gather_s": "≤ 2 s",
    "opening.relight_s": "≤ 1 s",
    "opening.relight_gather_s": "≤ 2 s",
    "opening.large_first_s": "≤ 1 s",
    "opening.large_exact_s": "≤ 5 s",
    "opening.large_edit_ms": "≤ 33 ms",
    "opening.larger_ratio": "≤ 1",
    "memory.server_growth": "≤ 0.1",
    "flood.latency_ratio": "≤ 2",
    "slow_readers.mb": "≤ 50 MB",
    "rooms.join_s": "≤ 1 s",
    "btf.several_ratio": "≤ 3.5",
    "btf.five_vs_two": "≤ 1.1",
    "plan.disk_ratio": "1 to 3",
    "demo.bake_s": "≤ 30 s",
    "demo.first_picture_s": "≤ 10 s",
}

PEERS = {
    "accuracy.": "reference, every texel",
    "assets.": "Mitsuba 3, its own reader",
    "bake.ray_saving": "1, every ray traced",
    "bake.rays_vs_embreex": "`embreex`, same rays",
    "bake.teatray_s": "Ben-Artzi 2006, size of Teatray",
    "bake.two_workers_speedup": "2, cores",
    "render.two_workers_speedup": "2, cores",
    "bake.wall_vs_rays": "1, tracing kernels alone",
    "btf.compression_error": "uncompressed BTF",
    "btf.compression_flat_error": "uncompressed BTF",
    "btf.five_vs_two": "1, edit with two BTFs",
    "btf.geometry_rmse": "path tracing of the geometry",
    "btf.moving_rmse": "path tracing of the geometry",
    "btf.light_bytes": "640 kB HDR, 11 MB tables",
    "btf.several_ratio": "1, edit without BTFs",
    "btf.sphere_rmse": "path tracing of the geometry",
    "btf.table_rmse": "uncompressed BTF",
    "estimators.": "path tracing",
    "factorization.hemisphere_eigenvalues": "F_l",
    "factorization.measured_terms": "0.25, Mahajan 2008",
    "factorization.phong_terms_per_exponent": "2.5, Mahajan 2008",
    "factorization.picture_rmse": "exact picture",
    "factorization.sphere_eigenvalues": "F_l in closed form",
    "factorization.sphere_terms_per_exponent": "5 to 6, Mahajan 2008",
    "factorization.torrance_sparrow_terms_sigma2": "2.4, Mahajan 2008",
    "flood.latency_ratio": "1, quiet server",
    "frame.bandwidth_ratio": "1, summing the same bytes",
    "frame.incremental_rmse": "T · c in float64",
    "free_camera.blots": "the static view",
    "free_camera.rmse_": "Mitsuba 3",
    "freeze.curve_switch_s": "2.1 s, Ben-Artzi 2006",
    "gather.full_": "Mitsuba 3, whole materials",
    "gather.incremental_error": "the same look, shaded",
    "gather.rmse_": "Mitsuba 3",
    "glass.rmse": "Mitsuba 3 `volpath`",
    "glass.rmse_frosted": "Mitsuba 3 `volpath`",
    "large.bytes_ratio": "1, float32",
    "large.frame_ratio": "1, float32",
    "lights.rmse_": "Mitsuba 3",
    "load.aggregate_ratio": "1, best session count",
    "load.drag_with_renders_ratio": "1, no renders",
    "memory.": "323 MB, server at start",
    "mirror.": "Mitsuba 3",
    "opening.larger_ratio": "1, ratio of pixels",
    "free_camera.all_vs_sun": "1, Sun 2007",
    "free_camera.brdf_vs_sun": "1, Sun 2007",
    "free_camera.view_vs_sun": "1, Sun 2007",
    "free_camera.all_rmse": "the static view",
    "paper.fig5_incremental": "4.8e-8, Ben-Artzi 2006",
    "paper.fig5_non_linear": "0.12, Ben-Artzi 2006",
    "pca.blinn_phong_6": "1e-5, Nguyen 2010 (norm not stated)",
    "peer.cycles_time_ratio": "Cycles 5",
    "peer.mitsuba_": "Mitsuba 3",
    "plan.disk_ratio": "1, bytes used",
    "preview.": "shading all samples",
    "probes.against_fixed_": "fixed view of the same bake",
    "probes.canvas_fps": "11.1 frames/s, the server",
    "probes.incremental_error": "the converged change",
    "probes.probe_rmse": "path tracing",
    "probes.rmse_": "Mitsuba 3",
    "reference.mitsuba": "Mitsuba 3",
    "roughness.rmse": "Mitsuba 3",
    "scaling.cpu_prediction": "1, simulated",
    "scaling.calls_prediction": "1, simulated",
    "scaling.farm_calls_prediction": "1, simulated",
    "shade.pairs_per_s_vs_limit": "1, angles alone",
    "shade.vs_operator_sums": "1, sums of the operator",
    "sharp.moving_rmse_": "Mitsuba 3",
    "sharp.peak_": "1, Mitsuba 3",
    "sharp.rmse_": "Mitsuba 3",
    "sharp.speckle_": "1, Mitsuba 3",
    "sharp.static_rmse_": "Mitsuba 3",
    "slider.drag_error": "the same look, shaded",
    "slider.freeze_ratio": "1, operator along θh",
    "slider.sharp_": "the same look, shaded",
    "slow_readers.mb": "14.3 MB × 60 readers",
}
"""Peer of a figure, by its name or prefix: a limit of the machine, a paper, a renderer."""


def find_peer(name: str) -> str:
    """Limit or peer of a figure; empty if there is none."""
    return next((peer for start, peer in PEERS.items() if name.startswith(start)), "")


def find_document(name: str) -> str:
    """Page and file of a figure, by name without suffix."""
    return (
        "accuracy"
        if name.startswith(
            (
                "accuracy.",
                "reference.",
                "paper.",
                "pca.",
                "gather.rmse",
                "gather.full",
                "assets.",
                "export.",
                "glass.",
                "roughness.",
                "mirror.",
                "sharp.peak",
                "sharp.rmse",
                "sharp.speckle",
                "sharp.static",
                "sharp.moving",
                "lights.rmse",
                "free_camera.rmse",
                "free_camera.blots",
                "free_camera.all_rmse",
                "free_camera.correction",
                "btf.compression_error",
                "btf.compression_flat",
                "btf.compression_ratio",
                "btf.geometry",
                "btf.moving",
                "btf.sphere",
                "btf.table",
            )
        )
        or name == "frame.incremental_rmse"
        else "performance"
    )


def row(figure: dict[str, Any], *, is_older: bool = False) -> str:
    """One row of a table. is_older: than the code that it measures"""
    date = str(figure["context"].get("measured_on", "")).partition(",")[0]
    name = figure["name"]
    target = TARGETS.get(name, "") + (" (missed)" if "known_miss" in figure else "")
    return f"| `{name}` | {value_text(figure)} | {target} | {find_peer(name)} | {date}{OLDER * is_older} |"


def value_text(figure: dict[str, Any]) -> str:
    """Value, standard error and unit of a figure; errors in percent."""
    if figure["value"] is None:
        return "not measured"
    if figure["unit"] == "relative RMSE" and figure["value"] > 1e-4:
        return f"{100 * figure['value']:.2f}{_spread(figure, 100)} %"
    return f"{figure['value']:.3g}{_spread(figure)} {figure['unit'].replace('ratio', '×')}"


def _spread(figure: dict[str, Any], scale: float = 1.0) -> str:
    """Standard error of an estimate, to two digits."""
    error = figure.get("standard_error")
    return "" if error is None else f" ± {scale * error:.2g}"


def merge(stored: list[dict[str, Any]], measured: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Stored figures, replaced by measured ones of the same name, sorted by name; the reasons of known misses stay."""
    figures = {figure["name"]: figure for figure in stored}
    for figure in measured:
        miss = figures.get(figure["name"], {}).get("known_miss")
        figures[figure["name"]] = {**figure, **({} if miss is None else {"known_miss": miss})}
    return [figures[name] for name in sorted(figures)]


def filled(text: str, figures: list[dict[str, Any]], older: Collection[str] = ()) -> str:
    """Fill a page with these figures. Raises ValueError if the page has no marks.

    Args:
        text: of the page. figures: entries of its file. older: names of figures older than the code that they measure.
    """
    before, _, suffix = text.partition(BEGIN)
    _, mark, after = suffix.partition(END)
    if not mark:
        raise ValueError("the page has no table of figures; add the two marks of relume_bench.table")
    return "\n".join([before + BEGIN, *HEAD, *(row(f, is_older=f["name"] in older) for f in figures), END]) + after


def main() -> int:
    """Read the JSON list from standard input and write both files and pages."""
    from relume_bench.registry import find_older  # it imports this module

    measured = json.load(sys.stdin)
    for name in PAGES:
        file, page = DOCS / f"{name}.json", DOCS / f"{name}.md"
        mine = [figure for figure in measured if find_document(figure["name"]) == name]
        figures = merge(json.loads(file.read_text()), mine)
        lines = ",".join("\n" + json.dumps(figure, ensure_ascii=False) for figure in figures)
        file.write_text(f"[{lines}\n]\n")
        older = find_older({figure["name"]: figure for figure in figures})
        page.write_text(filled(page.read_text(), figures, older))
        asset_table.fill_page(DOCS, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
