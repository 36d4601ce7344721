"""Compare two looks: the relative RMS difference of their radiance, and an image of both side by side."""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from relume_client import Client

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="width and height")
parser.add_argument("--out", type=Path, default=Path("compared.png"))
arguments = parser.parse_args()

with Client() as client:
    bake = client.example("still_life").bake("direct", size=arguments.size).wait(progress=True)
    with bake.session() as session:
        first, first_shown = session.frame(linear=True), session.frame()
        session["Table"].terms[0].color = 0.5, 0.1, 0.1
        second, second_shown = session.frame(linear=True), session.frame()

difference = np.sqrt(np.mean((second - first) ** 2) / np.mean(first**2))
print(f"relative RMS difference: {difference:.1%}")
Image.fromarray(np.concatenate([first_shown, second_shown], axis=1)).save(arguments.out)
