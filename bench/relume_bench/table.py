"""Writes figures into docs/performance.md and docs/accuracy.md: `relume bench --json | python -m relume_bench.table`.

A table stands between two marks; its rows are kept by name, so that a run of a few figures leaves the others.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- figures: relume bench --json | python -m relume_bench.table -->", "<!-- end of figures -->"
HEAD = ["| figure | value | target | how it came about |", "|---|---|---|---|"]

TARGETS = {
    "frame.bandwidth_ratio": "≥ 0.8",
    "frame.incremental_rmse": "≤ 1e-4",
    "freeze.curve_switch_s": "≤ 0.3 s",
    "freeze.terms_s": "≤ 0.8 s",
    "shade.pairs_per_s_vs_limit": "≥ 0.3",
    "session.edit_to_socket_ms.p50": "≤ 10 ms",
    "session.edit_to_socket_ms.p95": "≤ 20 ms",
    "load.drag_with_renders_ratio": "≥ 0.7",
    "load.aggregate_ratio": "≥ 0.9",
    "canvas.edit_to_pixels_ms.p50": "≤ 16 ms",
    "canvas.edit_to_pixels_ms.p95": "≤ 33 ms",
    "accuracy.lambert": "≤ 0.5 %",
    "accuracy.cook_torrance_0.2": "≤ 0.8 %",
    "accuracy.cook_torrance_0.05": "≤ 4 %",
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
    "store.bytes_per_view_sample": "≤ 600",
    "assets.rmse": "≤ 5 %",
    "mirror.rmse": "≤ 10 %",
    "mirror.sharp_rmse": "≤ 5 %",
    "gather.bake_s": "≤ 4 s",
    "probes.bake_s": "≤ 60 s",
    "probes.bytes_per_probe": "≤ 1000",
    "probes.view_fps": "≥ 15",
    "probes.brdf_vs_sun": "≥ 10",
    "probes.canvas_fps": "≥ 15",
    "btf.compression_error": "≤ 2 %",
    "btf.compression_s": "≤ 300 s",
    "btf.geometry_rmse": "≤ 5 %",
    "btf.table_rmse": "≤ 2 %",
    "btf.view_fps": "≥ 24",
    "btf.light_ms": "≤ 80 ms",
    "btf.light_bytes": "≤ 50 kB",
    "probes.rmse_diffuse": "≤ 3 %",
    "probes.rmse_hard_sun": "≤ 8 %",
    "probes.rmse_glossy_0.5": "≤ 6 %",
    "probes.rmse_glossy_0.3": "≤ 12 %",
    "probes.rmse_ggx_0.5": "≤ 6 %",
    "probes.rmse_ggx_0.3": "≤ 12 %",
    "probes.probe_rmse": "≤ 1 %",
    "probes.all_vs_sun": "≥ 5",
    "probes.first_edit_s": "≤ 1 s",
    "probes.incremental_error": "≤ 10 %",
    "probes.static_view_s": "≤ 10 s",
    "probes.correction_s": "≤ 1 s",
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


def find_document(name: str) -> str:
    """Which document a figure belongs to."""
    return (
        "accuracy.md"
        if name.startswith(
            (
                "accuracy.",
                "reference.",
                "paper.",
                "pca.",
                "gather.rmse",
                "gather.full",
                "assets.",
                "glass.",
                "roughness.",
                "mirror.",
                "lights.rmse",
                "btf.compression_error",
                "btf.compression_ratio",
                "btf.geometry",
                "btf.sphere",
                "btf.table",
            )
        )
        or name == "frame.incremental_rmse"
        else "performance.md"
    )


def row(figure: dict[str, Any]) -> str:
    """One line of a table."""
    context = figure["context"]
    if figure["value"] is None:
        value = "not measured"
    elif figure["unit"] == "relative RMSE" and figure["value"] > 1e-3:
        value = f"{100 * figure['value']:.2f}{_spread(figure, 100)} %"
    else:
        value = f"{figure['value']:.3g}{_spread(figure)} {figure['unit'].replace('ratio', '×')}"
    context_text = "; ".join(f"{key} {_short(item)}" for key, item in context.items() if key not in ("their_steps",))
    return f"| `{figure['name']}` | {value} | {TARGETS.get(figure['name'], '')} | {context_text.replace('|', '/')} |"


def _spread(figure: dict[str, Any], scale: float = 1.0) -> str:
    """The standard error of an estimate, to two digits."""
    error = figure.get("standard_error")
    return "" if error is None else f" ± {scale * error:.2g}"


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1e5 else f"{value:.2e}"
    if isinstance(value, dict):
        return "(" + ", ".join(f"{key} {_short(item)}" for key, item in value.items()) + ")"
    return "×".join(map(_short, value)) if isinstance(value, list) else str(value)


def filled(text: str, figures: list[dict[str, Any]]) -> str:
    """A document with new rows in its table. Raises ValueError where it has no marks."""
    before, _, suffix = text.partition(BEGIN)
    table, mark, after = suffix.partition(END)
    if not mark:
        raise ValueError(
            "the document has no table of figures; put the two marks of bench/relume_bench/table.py into it"
        )
    rows = {line.split("`")[1]: line for line in table.splitlines() if line.startswith("| `")}
    rows |= {figure["name"]: row(figure) for figure in figures}
    return "\n".join([before + BEGIN, *HEAD, *(rows[name] for name in sorted(rows)), END]) + after


def main() -> int:
    """Read the JSON list from standard input and write both documents."""
    figures = json.load(sys.stdin)
    for name in ("performance.md", "accuracy.md"):
        path = DOCS / name
        document_figures = [figure for figure in figures if find_document(figure["name"]) == name]
        path.write_text(filled(path.read_text(), document_figures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
