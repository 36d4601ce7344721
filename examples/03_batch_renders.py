"""Render a series of looks, a file each, on the server: the roughness of the bowl."""

import argparse
from pathlib import Path

import numpy as np

from relume_client import Client

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="width and height")
parser.add_argument("--steps", type=int, default=5)
parser.add_argument("--out", type=Path, default=Path("roughness"))
arguments = parser.parse_args()

with Client() as client:
    bake = client.example("still_life").bake("direct", size=arguments.size).wait(progress=True)
    looks = [bake.look() for _ in range(arguments.steps)]
    for look, roughness in zip(looks, np.linspace(0.1, 0.6, arguments.steps), strict=True):
        look["Bowl"].roughness = roughness
    files = bake.render(looks, arguments.out / "roughness_{}.png", progress=True)
    print(*files, sep="\n")
