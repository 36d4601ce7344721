"""Turn the environment around the scene, in a live session, and save each exact image."""

import argparse
from pathlib import Path

from PIL import Image

from relume_client import Client

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="width and height")
parser.add_argument("--steps", type=int, default=12)
parser.add_argument("--out", type=Path, default=Path("light_sweep"))
arguments = parser.parse_args()
arguments.out.mkdir(parents=True, exist_ok=True)

with Client() as client:
    bake = client.example("still_life").bake("direct", size=arguments.size, relightable=True).wait(progress=True)
    with bake.session() as session:
        for step in range(arguments.steps):
            session.look.environment.rotation = 360 * step / arguments.steps
            Image.fromarray(session.frame(exact=True)).save(arguments.out / f"{step:03}.png")
