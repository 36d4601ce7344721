"""Runs in the Python that has bpy: executes each line of stdin, JSON of Python source, and answers with `result`.

`blender_worker.py URL`: with the add-on registered, and this server in its preferences.
"""

import json
import sys
import traceback
import warnings
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
ANSWER = "\x1erelume "


def main(url: str) -> None:
    sys.path[:0] = [str(ROOT / "blender"), str(ROOT / "client"), str(Path(__file__).parent)]
    warnings.simplefilter("ignore", DeprecationWarning)
    import relume_blender

    relume_blender.register()
    scope = {"bpy": bpy, "clear": lambda: clear(url)}
    clear(url)
    for line in sys.stdin:
        scope["result"] = None
        try:
            exec(json.loads(line), scope)
            answer = {"result": scope["result"]}
        except Exception:
            answer = {"error": traceback.format_exc()}
        sys.stdout.write(f"{ANSWER}{json.dumps(answer)}\n")
        sys.stdout.flush()


def clear(url: str) -> None:
    """An empty file, the add-on's preferences as at the start."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addons = bpy.context.preferences.addons
    if "relume_blender" not in addons:
        addons.new().module = "relume_blender"
    addons["relume_blender"].preferences.url = url
    bpy.context.scene.relume.method, bpy.context.scene.relume.preset = "direct", "preview"


if __name__ == "__main__":
    main(sys.argv[1])
