"""Registry of benchmarks, and the loop that runs them. To add one, write its module and add a line here."""

from __future__ import annotations

import importlib
import json
import sys
import time
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import date
from typing import Any

from relume.store.schema import SCHEMA_VERSION
from relume_bench.check import HEAD, Verdict, judge, line
from relume_bench.figure import Figure
from relume_bench.machine import measure_stolen_fraction, processor_ticks
from relume_bench.measured_code import is_older, measured_code
from relume_bench.pages import stored_figures


@dataclass(frozen=True)
class Group:
    """Figures that are measured together, by `measure(tiny, *arguments)` of a module.

    Attributes:
        is_quick: `make test` checks them: accuracy without files or programs of others, in seconds.
        arguments: choose the figures of a module with several groups.
    """

    module: str
    names: tuple[str, ...]
    is_quick: bool = False
    arguments: tuple[str | float, ...] = ()

    def measure(self, tiny: bool) -> list[Figure]:
        """Measure; a failure becomes a figure without a value.

        Args:
            tiny: meaningless sizes that take seconds, for the tests.
        """
        start_time, ticks = time.perf_counter(), processor_ticks()
        try:
            figures: list[Figure] = importlib.import_module(self.module).measure(tiny, *self.arguments)
        except Exception as error:  # the other groups must still run
            traceback.print_exc()
            return [Figure(name, None, "", {"failed": f"{type(error).__name__}: {error}"[:500]}) for name in self.names]
        details = {
            "measured_in_s": round(time.perf_counter() - start_time, 1),
            "stolen_share": measure_stolen_fraction(ticks, processor_ticks()),
            "measured_on": f"{date.today().isoformat()}, schema {SCHEMA_VERSION}",
            "code": measured_code(self.module),
        }
        return [replace(figure, context={**figure.context, **details}) for figure in figures]


GROUPS = (
    Group("relume_bench.bandwidth", ("frame.bandwidth_ratio",)),
    Group("relume_bench.incremental", ("frame.incremental_rmse",)),
    Group("relume_bench.curve_switch", ("freeze.curve_switch_s",)),
    Group("relume_bench.curve_switch_terms", ("freeze.terms_s",)),
    Group("relume_bench.shade", ("shade.pairs_per_s_vs_limit", "shade.vs_operator_sums")),
    Group(
        "relume_bench.opening",
        (
            "opening.first_s",
            "opening.exact_s",
            "opening.exact_gather_s",
            "opening.prewarmed_s",
            "opening.prewarmed_gather_s",
            "opening.relight_s",
            "opening.relight_gather_s",
            "opening.large_first_s",
            "opening.large_exact_s",
            "opening.large_edit_ms",
            "opening.larger_ratio",
        ),
    ),
    Group("relume_bench.turning", ("turning.fps", "turning.error", "turning.polished_error")),
    Group("relume_bench.slider_drag", ("slider.drag_error", "slider.frame_ms", "slider.freeze_ratio")),
    Group("relume_bench.large", ("large.frame_ms", "large.frame_ratio", "large.bytes_ratio")),
    Group("relume_bench.sharp_slider", ("slider.sharp_error", "slider.sharp_levels")),
    Group("relume_bench.accuracy", ("accuracy.lambert", "accuracy.cook_torrance_0.2", "accuracy.cook_torrance_0.05")),
    Group(
        "relume_bench.accuracy_generated",
        (
            "accuracy.generated_lambert",
            "accuracy.generated_cook_torrance_0.2",
            "accuracy.generated_cook_torrance_0.05",
        ),
        is_quick=True,
    ),
    Group(
        "relume_bench.accuracy_terms",
        (
            "accuracy.oren_nayar",
            "accuracy.phong",
            "accuracy.blinn_phong",
            "accuracy.lafortune",
            "accuracy.ward",
            "accuracy.ward_duer",
            "accuracy.ward_anisotropic",
            "accuracy.ashikhmin_shirley",
            "accuracy.cook_torrance",
            "accuracy.schlick",
            "accuracy.beard_maxwell",
            "accuracy.ggx",
        ),
    ),
    Group("relume_bench.paper_fig5", ("paper.fig5_incremental", "paper.fig5_non_linear"), is_quick=True),
    Group("relume_bench.reference", ("reference.mitsuba",)),
    Group("relume_bench.rotation", ("accuracy.rotation_lambert", "accuracy.rotation_cook_torrance_0.2")),
    Group("relume_bench.swap", ("accuracy.swap_lambert", "accuracy.swap_cook_torrance_0.2")),
    Group("relume_bench.pca", ("pca.blinn_phong_6", "pca.vectors", "pca.slider_nodes"), is_quick=True),
    Group("relume_bench.rays", ("bake.rays_vs_embreex",)),
    Group("relume_bench.bake", ("bake.wall_vs_rays", "bake.teatray_s")),
    Group("relume_bench.ray_saving", ("bake.ray_saving",)),
    Group("relume_bench.store_size", ("store.bytes_per_view_sample",)),
    Group("relume_bench.plan_disk", ("plan.disk_ratio",)),
    Group("relume_bench.plan", ("plan.memory_share", "plan.samples_share", "plan.store_share", "plan.rays_share")),
    Group("relume_bench.mesh_files", ("import.obj", "import.ply")),
    Group("relume_bench.import_clay", ("import.clay_s",)),
    Group("relume_bench.cryptomatte_file", ("export.cryptomatte_error",), is_quick=True),
    Group("relume_bench.export_round_trip", ("export.glb_rmse", "export.errors")),
    Group("relume_bench.export_blender", ("export.blender_error",)),
    Group("relume_bench.render_workers", ("render.two_workers_speedup",)),
    Group("relume_bench.workers", ("bake.two_workers_speedup",)),
    Group("relume_bench.session", ("session.edit_to_socket_ms.p50", "session.edit_to_socket_ms.p95")),
    Group("relume_bench.refusal", ("import.refusal_ms",)),
    Group("relume_bench.setup_kernels", ("setup.kernels_s",)),
    Group("relume_bench.slow_readers", ("slow_readers.mb",)),
    Group("relume_bench.room_join", ("rooms.join_s",)),
    Group("relume_bench.load", ("load.drag_with_renders_ratio",)),
    Group("relume_bench.many_sessions", ("load.aggregate_ratio", "load.frame_cost_ratio")),
    Group("relume_bench.flood", ("flood.latency_ratio",)),
    Group(
        "relume_bench.scaling.unit_costs",
        (
            "scaling.slider_frame_ms",
            "scaling.light_frame_ms",
            "scaling.free_camera_frame_ms",
            "scaling.frame_kb",
            "scaling.view_mb",
            "scaling.session_mb",
            "scaling.bake_cpu_s",
            "scaling.render_cpu_s",
        ),
    ),
    Group(
        "relume_bench.scaling.simulation",
        (
            "scaling.cpu_prediction",
            "scaling.calls_prediction",
            "scaling.farm_calls_prediction",
            "scaling.calls_per_person",
            "scaling.calls_per_bake",
            "scaling.server_frame_ms",
            "scaling.edit_ms.p50",
            "scaling.edit_ms.p95",
            "scaling.claim_s",
            "scaling.fairness",
            "scaling.lock_errors",
        ),
    ),
    Group("relume_bench.demo", ("demo.preview_s", "demo.bake_s", "demo.first_picture_s")),
    Group("relume_bench.canvas", ("canvas.edit_to_pixels_ms.p50", "canvas.edit_to_pixels_ms.p95")),
    Group("relume_bench.gather", ("gather.bake_s", "gather.store_mb", "gather.freeze_s", "gather.brdf_fps")),
    Group(
        "relume_bench.probes_reference",
        tuple(
            f"probes.rmse_{kind}" for kind in ("diffuse", "hard_sun", "glossy_0.5", "glossy_0.3", "ggx_0.5", "ggx_0.3")
        ),
    ),
    Group(
        "relume_bench.free_camera_accuracy",
        ("free_camera.rmse_median", "free_camera.rmse_worst", "free_camera.blots"),
    ),
    Group(
        "relume_bench.free_camera_exact",
        (
            "free_camera.exact_s_cornell",
            "free_camera.exact_s_still_life",
            "free_camera.exact_s_interior",
            "probes.correction_s",
        ),
    ),
    Group("relume_bench.free_camera_correction", ("free_camera.correction_ratio",)),
    Group("relume_bench.canvas_free_camera", ("probes.canvas_fps",)),
    Group(
        "relume_bench.btf",
        ("btf.compression_error", "btf.compression_flat_error", "btf.compression_ratio", "btf.compression_s"),
    ),
    Group("relume_bench.btf_accuracy", ("btf.geometry_rmse", "btf.sphere_rmse", "btf.table_rmse")),
    Group("relume_bench.btf_moving", ("btf.moving_rmse",)),
    Group("relume_bench.btf_speed", ("btf.view_fps", "btf.light_ms", "btf.light_bytes")),
    Group("relume_bench.btf_edit", ("btf.edit_ms",)),
    Group("relume_bench.btf_several", ("btf.several_ratio", "btf.five_vs_two")),
    Group(
        "relume_bench.factorization",
        (
            "factorization.phong_terms_per_exponent",
            "factorization.torrance_sparrow_terms_sigma2",
            "factorization.sphere_eigenvalues",
            "factorization.sphere_terms_per_exponent",
            "factorization.hemisphere_eigenvalues",
        ),
    ),
    Group("relume_bench.factorization_measured", ("factorization.measured_terms",)),
    Group("relume_bench.factorization_pictures", ("factorization.picture_rmse",)),
    Group(
        "relume_bench.probes",
        (
            "probes.bake_s",
            "probes.bytes_per_probe",
            "probes.view_fps",
            "probes.sun_fps",
            "probes.brdf_ms",
            "probes.light_ms",
            "probes.against_fixed_diffuse",
            "probes.against_fixed_glossy_0.5",
            "probes.against_fixed_glossy_0.3",
        ),
    ),
    Group(
        "relume_bench.free_camera_sun",
        (
            "free_camera.view_vs_sun",
            "free_camera.brdf_vs_sun",
            "free_camera.all_vs_sun",
            "free_camera.light_age_ms_13k",
            "free_camera.light_age_ms_36k",
            "free_camera.light_age_ms_62k",
            "free_camera.all_rmse",
        ),
    ),
    Group("relume_bench.probes_error", ("probes.probe_rmse",)),
    Group("relume_bench.probes_live", ("probes.first_edit_s", "probes.incremental_error")),
    Group("relume_bench.gather_interior", ("gather.interior_bake_s", "gather.interior_store_mb")),
    Group(
        "relume_bench.gather_lights",
        ("gather.light_move_fps", "gather.area_light_move_fps", "gather.light_intensity_fps"),
    ),
    Group("relume_bench.gather_incremental", ("gather.incremental_error",)),
    Group("relume_bench.gather_error", ("gather.rmse_diffuse", "gather.rmse_glossy")),
    Group(
        "relume_bench.gather_scenes",
        ("gather.rmse_cornell_box", "gather.rmse_tableau", "gather.rmse_still_life", "gather.rmse_interior"),
    ),
    Group(
        "relume_bench.gather_full",
        tuple(
            f"gather.full_{kind}_{scene}"
            for scene in ("cornell_box", "tableau", "still_life", "interior")
            for kind in ("rmse", "bias")
        ),
    ),
    Group("relume_bench.glass", ("glass.rmse", "glass.rmse_frosted")),
    Group("relume_bench.roughness_maps", ("roughness.rmse",)),
    Group(
        "relume_bench.assets",
        ("assets.rmse_median", "assets.rmse_p90", "assets.flip_median", "assets.flip_p90"),
    ),
    *(
        Group("relume_bench.sharp", (f"sharp.rmse_{r}", f"sharp.speckle_{r}"), arguments=("metal", r))
        for r in (0.02, 0.05, 0.1, 0.2, 0.3)
    ),
    *(Group("relume_bench.sharp", (f"sharp.rmse_plastic_{r}",), arguments=("plastic", r)) for r in (0.05, 0.1)),
    Group("relume_bench.sharp_room", ("sharp.rmse_room",)),
    Group("relume_bench.sharp_checker", ("sharp.rmse_checker",)),
    Group("relume_bench.sharp_maps", ("sharp.rmse_normal_map", "sharp.peak_normal_map"), arguments=("bumps",)),
    Group("relume_bench.sharp_maps", ("sharp.rmse_roughness_map", "sharp.rmse_anisotropic"), arguments=("balls",)),
    Group(
        "relume_bench.sharp_free_camera",
        tuple(f"sharp.{kind}_rmse_{r}" for r in (0.02, 0.05, 0.1, 0.2, 0.3) for kind in ("static", "moving")),
    ),
    Group("relume_bench.sharp_edits", ("sharp.clean_s", "sharp.drag_fps")),
    Group("relume_bench.lens", ("lens.rmse",)),
    Group("relume_bench.mirror", ("mirror.rmse", "mirror.sharp_rmse")),
    Group(
        "relume_bench.estimators",
        (
            "estimators.final_gather",
            "estimators.connect_equal_rays",
            "estimators.connect_equal_store",
            "estimators.connect_all",
        ),
    ),
    Group("relume_bench.light_groups", ("lights.groups_ms",), arguments=("lights.groups_ms",)),
    Group("relume_bench.light_groups", ("lights.groups_rmse_1000",), arguments=("lights.groups_rmse_1000",)),
    Group("relume_bench.light_groups", ("lights.groups_rmse_10000",), arguments=("lights.groups_rmse_10000",)),
    Group(
        "relume_bench.lights",
        (
            "lights.rmse_point",
            "lights.rmse_spot",
            "lights.rmse_directional",
            "lights.rmse_linked",
            "lights.rmse_rectangle",
            "lights.rmse_disc",
            "lights.rmse_sphere",
            "lights.rmse_tube",
            "lights.rmse_sun",
            "lights.rmse_ies",
            "lights.rmse_gobo",
            "lights.intensity_fps",
        ),
    ),
    Group("relume_bench.solve", ("solve.error", "solve.error_noisy", "solve.ms")),
    Group(
        "relume_bench.memory",
        (
            "memory.server_after_mb",
            "memory.workers_after_mb",
            "memory.server_idle_mb",
            "memory.workers_idle_mb",
            "memory.server_growth",
        ),
    ),
    Group("relume_bench.peer_mitsuba", ("peer.mitsuba_time_ratio",)),
    Group("relume_bench.peer_gather", ("peer.mitsuba_gather_time_ratio", "peer.cycles_time_ratio")),
)


_NOTEWORTHY = 0.02


def names() -> list[str]:
    """All figures, in order of measurement."""
    return [name for group in GROUPS for name in group.names]


def measure(prefix: str, tiny: bool = False, *, quick: bool = False) -> Iterator[Figure]:
    """Measure the groups with a figure whose name starts with `prefix`; yield all their figures.

    Args:
        prefix: of a figure of each group; "" for all.
        tiny: meaningless sizes that take seconds, for the tests.
        quick: only groups that are quick.
    """
    for group in GROUPS:
        if (group.is_quick or not quick) and any(name.startswith(prefix) for name in group.names):
            yield from group.measure(tiny)


def find_older(stored: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Names of figures that must be measured again: without a stored value, or older than their code.

    Args:
        stored: entries of the pages by name.
    """
    names = ((name, group.module) for group in GROUPS for name in group.names)
    return [name for name, module in names if name not in stored or is_older(stored[name], module)]


def print_older(prefix: str) -> int:
    """Print the figures of `find_older` with the date of their row; 1 if there are any.

    Args:
        prefix: prefix of the figures; "" for all.
    """
    stored = stored_figures()
    older = [name for name in find_older(stored) if name.startswith(prefix)]
    for name in older:
        print(f"{name:<38} {stored[name]['context']['measured_on'] if name in stored else 'never measured'}")
    return int(bool(older))


def run(prefix: str, as_json: bool, tiny: bool = False, *, quick: bool = False, check: bool = False) -> int:
    """Measure and print; 1 if something failed, is past its target, or no figure has such a name.

    Args:
        prefix: prefix of the figures to measure; "" for all.
        as_json: print a list of figures to stdout, and text to stderr.
        tiny: meaningless sizes that take seconds, for the tests.
        quick: only groups that are quick.
        check: print each figure's target and whether it meets it.
    """
    if not any(name.startswith(prefix) for name in names()):
        print(f"relume: no benchmark starts with {prefix!r}; choose from {', '.join(names())}", file=sys.stderr)
        return 1
    stored, text = stored_figures() if check else {}, sys.stderr if as_json else sys.stdout
    if check:
        print(HEAD, file=text, flush=True)
    figures, is_ok = [], True
    for figure in measure(prefix, tiny, quick=quick):
        figures.append(figure)
        verdict = judge(figure, stored) if check else Verdict("failed" not in figure.context, "")
        is_ok = is_ok and verdict.is_ok
        print(line(figure, verdict) if check else _line(figure), file=text, flush=True)
    if as_json:
        print(json.dumps([_plain(asdict(figure)) for figure in figures], indent=1, allow_nan=False))
    return 0 if figures and is_ok else 1


def _line(figure: Figure) -> str:
    if figure.value is None:
        return f"{figure.name:<32} -  {figure.context.get('skipped') or figure.context.get('failed')}"
    stolen = figure.context.get("stolen_share") or 0
    stolen_note = f"   (the host gave {stolen:.0%} of the processor time to others)" if stolen >= _NOTEWORTHY else ""
    error = "" if figure.standard_error is None else f" ± {figure.standard_error:.2g}"
    return f"{figure.name:<32} {figure.value:.4g}{error} {figure.unit}{stolen_note}"


def _plain(value: Any) -> Any:
    """Round numbers for reading, and convert NumPy's to Python's."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return float(f"{value:.6g}") if isinstance(value, float) else value
