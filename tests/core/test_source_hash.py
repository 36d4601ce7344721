"""Source hashes of results: they change with the sources, which are found by following imports."""

from __future__ import annotations

import pytest

from relume.core import source_hash
from relume.core.source_hash import code_hash, collect_sources


@pytest.fixture
def package(tmp_path):
    sources = {
        "__init__": "",
        "trace/rays": "from package.light.area import Area\nimport package.errors\n",
        "trace/shadows": "import numpy as np\nfrom other.light import area\n",
        "light/area": "def of():\n    from package.scene import (\n        mesh,\n        model as described,\n    )\n",
        "light/unused": "",
        "scene/__init__": "from package.shown.frame import Frame\n",
        "scene/mesh": "from package.trace import rays  # a circle\n",
        "scene/model": "",
        "shown/frame": "from package.shown import only_here\n",
        "shown/only_here": "",
        "errors": "",
    }
    for name, text in sources.items():
        path = tmp_path / "package" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "package"


def names(package, paths):
    return {path.relative_to(package).with_suffix("").as_posix() for path in paths}


def test_sources_include_direct_and_indirect_imports(package):
    bake = {"trace/rays", "light/area", "scene/__init__", "scene/mesh", "scene/model", "errors"}
    shown = {"shown/frame", "shown/only_here"}
    assert names(package, collect_sources(["trace.rays"], package=package)) == bake | shown
    assert names(package, collect_sources(["trace"], package=package)) == bake | shown | {"trace/shadows"}


def test_a_missing_module_raises_an_error(package):
    with pytest.raises(ModuleNotFoundError, match="no sources"):
        collect_sources(["trace.photons"], package=package)


def test_the_hash_depends_on_imported_sources_only(package):
    def current():
        return code_hash(collect_sources(["trace.rays"], package=package), package)

    first = current()
    (package / "light" / "unused.py").write_text("x = 1\n")
    assert current() == first
    (package / "light" / "area.py").write_text("x = 1\n")
    second = current()
    assert second != first
    (package / "light" / "area.py").rename(package / "light" / "light.py")
    (package / "trace" / "rays.py").write_text("from package.light.light import Area\n")
    assert current() not in (first, second)


def test_image_hashes_depend_on_frame_code_and_bake_hashes_do_not():
    package = source_hash._PACKAGE
    images = names(package, collect_sources(source_hash._IMAGES))
    bakes = names(package, collect_sources(source_hash._BAKES))
    of_both = {
        "brdf/terms/ggx",
        "lights/sphere_tiles",
        "lights/spherical_triangles",
        "scene/model",
        "patches/patches",
        "views/store_io",
    }
    of_images = {
        "transport/project_kernel",
        "operators/shade",
        "raytrace/local_light_visibility",
        "lights/prefilter",
        "views/view",
    }
    of_bakes = {
        "raytrace/visibility_kernel",
        "patches/importons",
        "camera/view_samples",
        "methods/gather",
        "store/writer",
    }
    assert of_both <= images & bakes
    assert of_images <= images - bakes
    assert of_bakes | {"scene/scene_folder"} <= bakes
    assert not {name for name in images | bakes if name.startswith(("scene_io/", "reference/", "output/", "server"))}
