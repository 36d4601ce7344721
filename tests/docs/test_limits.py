"""The limits in docs/operations.md agree with the code."""

import re
from pathlib import Path

from relume.assets.environments import environment_store as environments
from relume.assets.environments import read_environment as environment
from relume.assets.ies import read_ies
from relume.assets.ies.ies_store import IES_FILES
from relume.assets.measured import measured_store as materials
from relume.brdf import term_validation as terms
from relume.brdf.texture_slots import IMAGES
from relume.camera.merge_rays import POSITIONS_PER_PIXEL
from relume.camera.tiling import TILE_SIZE
from relume.camera.view_samples import view_sample_limit
from relume.image_io import decode as images
from relume.images import read_image
from relume.lights.tile_subdivision import MAX_LIGHTS
from relume.look import document, patch
from relume.methods import plan_estimates
from relume.methods import view_stages as direct
from relume.scene import light_members, validate
from relume.scene_io import import_scene, referenced_files, zip_scene
from relume.scene_io.surfaces.make_material import MAX_TEXTURE_TEXELS
from relume_server.io import comment_images
from relume_server.persistence import comment_store, look_store, share_store
from relume_server.schemas import bodies, protocol, renders, rooms
from relume_server.schemas import comments as wire_comments
from relume_server.settings import Settings
from relume_worker import cameras

KIB, MIB, MILLION = 1 << 10, 1 << 20, 1_000_000
OPERATIONS = Path(__file__).resolve().parents[2] / "docs" / "operations.md"


def maximum(field: str) -> int:
    """The upper bound of a number in a comparison's request."""
    return int(bodies.ComparisonRequest.model_json_schema()["properties"][field]["maximum"])


ROWS = {
    "triangles of a scene": f"{validate.MAX_TRIANGLES // MILLION} million",
    "materials of a scene; terms of a material": f"{validate.MAX_MATERIALS:,}; {document.MAX_TERMS}",
    "local lights of a scene; lights in its sources of many": f"{validate.MAX_LIGHTS}; {light_members.MAX_MEMBERS:,}",
    "scene file; its referenced files together; files in a `.zip`": (
        f"{import_scene.MAX_FILE_BYTES // MIB} MiB; {referenced_files.MAX_BYTES // MIB} MiB; {zip_scene.MAX_ENTRIES:,}"
    ),
    "side of a scene's image; texels of all images; of all texture channels": (
        f"{images.MAX_SIDE:,} pixels; {images.MAX_TEXELS // MILLION} million; {MAX_TEXTURE_TEXELS // MILLION} million"
    ),
    "environment; its file; stored with a scene": (
        f"{environment.MAX_WIDTH:,} × {environment.MAX_HEIGHT:,}; {environment.MAX_FILE_BYTES // MILLION} MB; "
        f"{environment.SCENE_MAX_WIDTH:,} wide"
    ),
    "imported environments; stored width": f"{environments.STORE.max_entries}; {environments.MAX_WIDTH:,} wide",
    "uploaded images; size; file": (
        f"{IMAGES.max_entries:,}; {read_image.MAX_SIDE:,} × {read_image.MAX_SIDE:,}; "
        f"{read_image.MAX_FILE_BYTES // MILLION} MB"
    ),
    "uploaded IES files; file; angles": (
        f"{IES_FILES.max_entries:,}; {read_ies.MAX_FILE_BYTES // MILLION} MB; {read_ies.MAX_ANGLES:,} of each kind"
    ),
    "imported measured materials": f"{materials.STORE.max_entries}",
    "pixels of a baked view; environment triangles of a bake": f"{direct.MAX_PIXELS:,}; {MAX_LIGHTS:,}",
    "points of a curve": f"{terms.MAX_POINTS:,}",
    "operations of a patch; text message of a session": (
        f"{patch.MAX_OPERATIONS}; {protocol.MAX_MESSAGE_BYTES // KIB} KiB"
    ),
    "comments on a scene; in all; their images and texts together": (
        f"{comment_store.MAX_PER_SCENE}; {comment_store.MAX_COMMENTS:,}; {comment_store.MAX_BYTES // MIB} MiB"
    ),
    "text of a comment; side of its image, uploaded; stored": (
        f"{wire_comments.MAX_COMMENT:,} characters; {comment_images.MAX_SIDE:,}; {comment_images.STORED_SIDE} pixels"
    ),
    "participant name; room name": (f"{rooms.MAX_PERSON_NAME}; {rooms.MIN_ROOM} to {rooms.MAX_ROOM} characters"),
    "visible views; unacknowledged frames": (f"{protocol.MAX_VISIBLE_VIEWS}; {protocol.MAX_FRAMES_IN_FLIGHT}"),
    "custom cameras of a scene": f"{cameras.MAX_CAMERAS}",
    "saved look; number of looks": f"{look_store.MAX_LOOK_BYTES // KIB} KiB; {look_store.MAX_LOOKS:,}",
    "shared look; number of shared looks; total": (
        f"{share_store.MAX_SHARE_BYTES // KIB} KiB; {share_store.MAX_SHARES:,}; {share_store.MAX_BYTES // MIB} MiB"
    ),
    "looks and cameras of a batch render; its frames": f"{renders.MAX_LOOKS:,}; {renders.MAX_FRAMES:,}",
    "frames with listed looks; total": f"{renders.MAX_LISTED_FRAMES}; {renders.MAX_LISTED_BYTES // MIB} MiB",
    "passes of a comparison; queued jobs of each kind": f"{maximum('passes'):,}; {Settings().max_queued}",
    "pixels of a free-camera view": f"{protocol.MAX_CAMERA_PIXELS:,}",
}


def test_table_of_limits_agrees_with_the_code() -> None:
    section = OPERATIONS.read_text(encoding="utf-8").split("## Limits")[1].split("\n## ")[0]
    documented = dict(re.findall(r"^\| (?!what)(.+?) \| (.+?) \|$", section, re.MULTILINE))
    assert {limit: at_most for limit, at_most in documented.items() if limit in ROWS} == ROWS
    assert set(documented) - set(ROWS) == {"cached images of edited looks beside a bake"}


def test_documented_plan_figures_agree_with_plans() -> None:
    text = " ".join(OPERATIONS.read_text(encoding="utf-8").split())
    assert [view_sample_limit([], side * side) / side**2 for side in (256, 512, 1024, 4096)] == [8, 4, 2, 2]
    assert "eight view samples a pixel in pictures up to 256 × 256" in text
    assert "two from 1024 × 1024 on" in text
    assert f"the process ({plan_estimates.PROGRAM_BYTES // MILLION} MB)" in text
    assert f"({plan_estimates.LIGHT_BYTES_PER_TEXEL} bytes a texel)" in text
    assert f"({plan_estimates.BYTES_PER_RAY} bytes each, nine a pixel" in text
    assert POSITIONS_PER_PIXEL == 8
    assert f"a window of {TILE_SIZE} × {TILE_SIZE} of them" in text
