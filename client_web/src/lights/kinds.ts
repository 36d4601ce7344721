/** The kinds of light: their words, and a new light of each. */
import { DEFAULT_LIGHTS, MAX_LIGHT_NAME } from "../look.gen";
import type { Light, LightKind, Rgb, Triple } from "../protocol";
import { add, length, scaled, subtract, tidy } from "./vector";

/** Kinds that can be added; a mesh that shines only comes with a scene. */
export type AddedKind = Exclude<LightKind, "mesh">;

interface KindWords {
  kind: AddedKind;
  label: string;
  help: string;
  /** What a click in the picture shall be on. */
  click: string;
}

export const KINDS: readonly KindWords[] = [
  { kind: "point", label: "Point", help: "A bulb: shines alike in all directions", click: "hang the light" },
  { kind: "spot", label: "Spot", help: "Shines into a cone", click: "aim the spot" },
  { kind: "rectangle", label: "Panel", help: "A rectangle that shines to its front", click: "aim the panel" },
  { kind: "directional", label: "Sun", help: "Parallel light from far away", click: "aim the sun" },
];

export function labelOf(kind: LightKind): string {
  return KINDS.find((each) => each.kind === kind)?.label ?? "Shining surface";
}

/** The quantity that a light's emission is. */
export const UNITS: Record<LightKind, string> = {
  point: "W/sr",
  spot: "W/sr",
  directional: "W/m²",
  rectangle: "W/sr/m²",
  mesh: "W/sr/m²",
};

/** What a click in a picture found, and what light there is in it. */
export interface Clicked {
  position: Triple;
  /** Unit, towards the camera. */
  normal: Triple;
  /** From the camera, metres. */
  distance: number;
  /** Mean radiance of the picture. */
  radiance: number;
}

const OFFSET = 0.2;
const SIDE = 0.4;
/** Irradiance of a new light, of the picture's mean radiance: as bright as what is there on a surface of middle grey. */
const SHARE = 6;

/** Where a panel is put, so that its lower edge is not below what was clicked, which may stand on a floor. A panel that hangs
 * below what was clicked stays there. */
function raisedBy(clicked: Triple, place: Triple, direction: Triple, halfSide: number): Triple {
  const hangs = direction[1] > Math.SQRT1_2 * length(direction);
  const below = clicked[1] - (place[1] - halfSide * Math.sqrt(1 - (direction[1] / length(direction)) ** 2));
  return hangs || below <= 0 ? place : tidy(add(place, [0, below, 0]));
}

/** A light for what was clicked: off the surface by a part of the camera's distance, aimed at it, and as bright as the
 * rest of the picture. */
export function lightFor(kind: AddedKind, { position, normal, distance, radiance }: Clicked): Light {
  const offset = distance * OFFSET;
  const place = tidy(add(position, scaled(normal, offset)));
  const direction = tidy(subtract(position, place));
  const irradiance = SHARE * (radiance > 0 ? radiance : 1);
  const grey = (value: number): Rgb => Array<number>(3).fill(Number(value.toPrecision(2))) as Rgb;
  const intensity = grey(irradiance * offset ** 2);
  switch (kind) {
    case "point":
      return { ...DEFAULT_LIGHTS.point, emission: intensity, position: place };
    case "spot":
      return { ...DEFAULT_LIGHTS.spot, emission: intensity, position: place, direction };
    case "directional":
      return { ...DEFAULT_LIGHTS.directional, emission: grey(irradiance), direction };
    case "rectangle": {
      const side = Number((SIDE * offset).toPrecision(2));
      const emission = grey((irradiance * offset ** 2) / side ** 2);
      const raised = raisedBy(position, place, direction, side / 2);
      const aim = tidy(subtract(position, raised));
      return { ...DEFAULT_LIGHTS.rectangle, emission, position: raised, direction: aim, size: [side, side] };
    }
  }
}

/** The first of "Spot", "Spot 2", … that is free; after "Key 2" comes "Key 3". */
export function freeLightName(like: string, taken: readonly string[]): string {
  if (!taken.includes(like)) return like;
  const stem = like.replace(/ \d+$/, "").slice(0, MAX_LIGHT_NAME - 4);
  let n = 2;
  while (taken.includes(`${stem} ${n}`)) n += 1;
  return `${stem} ${n}`;
}

const BESIDE = 0.25;

/** A copy of a light, beside it where it has a place, so that their handles can be told apart. */
export function beside(light: Light): Light {
  if (!("position" in light)) return { ...light };
  const reach = "direction" in light ? length(light.direction) : 1;
  return { ...light, position: tidy(add(light.position, [BESIDE * Math.max(reach, 0.1), 0, 0])) };
}

/** A light with what a partial look says of it; what it does not say is as in `base`, or else as in a new light. */
export function completedLight(partial: Partial<Light>, base: Light | undefined): Light {
  const kind = partial.kind ?? base?.kind ?? "point";
  return { ...(base?.kind === kind ? base : DEFAULT_LIGHTS[kind]), ...partial } as Light;
}

/** The same light as another kind: what both have stays. */
export function withKind(light: Light, kind: AddedKind): Light {
  const start = DEFAULT_LIGHTS[kind];
  const shared = Object.entries(light).filter(([field]) => field !== "kind" && field in start);
  return { ...start, ...Object.fromEntries(shared) } as Light;
}
