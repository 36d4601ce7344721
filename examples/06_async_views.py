"""Two sessions at once, in an event loop: one edit in both, and the images as they come."""

import argparse
import asyncio

import numpy as np
from numpy.typing import NDArray

from relume_client import AsyncBake, AsyncClient

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="width and height")
arguments = parser.parse_args()


async def relit(bake: AsyncBake, intensity: float) -> NDArray[np.uint8]:
    async with bake.session() as session:
        session.look.environment.intensity = intensity
        return await session.frame(exact=True)


async def main() -> list[NDArray[np.uint8]]:
    async with AsyncClient() as client:
        scene = await client.example("still_life")
        bake = await (await scene.bake("direct", size=arguments.size)).wait(progress=True)
        return list(await asyncio.gather(relit(bake, 0.5), relit(bake, 2.0)))


dim, bright = asyncio.run(main())
print(f"mean of the images: {dim.mean():.1f}, {bright.mean():.1f}")
