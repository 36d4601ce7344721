"""Render a turn of the camera around the scene, which needs a bake with a free camera."""

import argparse
from pathlib import Path

from relume_client import Client

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="width and height")
parser.add_argument("--probes", type=int, default=50_000)
parser.add_argument("--steps", type=int, default=60)
parser.add_argument("--out", type=Path, default=Path("turntable"))
arguments = parser.parse_args()

with Client() as client:
    scene = client.example("cornell_box")
    bake = scene.bake("probes", size=arguments.size, probes=arguments.probes).wait(progress=True)
    look = bake.look({"display": {"exposure": 0.5}})
    files = bake.render(
        look, arguments.out / "{}.png", path={"turntable": arguments.steps}, quality="interactive", progress=True
    )
    print(*files, sep="\n")
