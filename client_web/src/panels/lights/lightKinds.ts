/** The kinds of light: labels, and creating a new one. */
import { DEFAULT_LIGHTS, MAX_LIGHT_NAME, RESERVED_LIGHT_NAMES } from "../../look.gen";
import type { Light, LightKind, Rgb, Triple } from "../../protocol";
import { isAimed } from "./handleGeometry";
import { add, length, normalize, scale, subtract, roundComponents } from "./vector";

/** Kinds that can be added; emissive meshes come with a scene or an emission map, sources of many lights with a scene. */
export type AddedKind = Exclude<LightKind, "mesh" | "points" | "panels" | "directionals" | "surfaces">;

interface LightKindLabels {
  kind: AddedKind;
  label: string;
  help: string;
  /** Purpose of the click that places the light. */
  click: string;
}

export const LIGHT_KINDS: readonly LightKindLabels[] = [
  { kind: "point", label: "Point", help: "Emits evenly in all directions", click: "place the light" },
  { kind: "spot", label: "Spot", help: "Emits in a cone", click: "aim the spot" },
  { kind: "rectangle", label: "Panel", help: "Rectangular area light (one-sided)", click: "aim the panel" },
  { kind: "disc", label: "Disc", help: "Round area light (one-sided)", click: "aim the disc" },
  { kind: "sphere", label: "Sphere", help: "Ball that emits from all of its surface", click: "place the sphere" },
  { kind: "tube", label: "Tube", help: "Fluorescent tube; its ends don't emit", click: "place the tube" },
  { kind: "directional", label: "Sun", help: "Distant light; an angle softens its shadows", click: "aim the sun" },
];

const SCENE_LABELS: Record<Exclude<LightKind, AddedKind>, string> = {
  mesh: "Emissive mesh",
  points: "Many lights",
  panels: "Many area lights",
  directionals: "Many sun lights",
  surfaces: "Emissive meshes",
};

export function labelOf(kind: LightKind): string {
  return isAddedKind(kind)
    ? (LIGHT_KINDS.find((candidate) => candidate.kind === kind)?.label ?? kind)
    : SCENE_LABELS[kind];
}

/** True if lights of a kind can be added, and their kind changed. */
export function isAddedKind(kind: LightKind): kind is AddedKind {
  return !(kind in SCENE_LABELS);
}

/** Unit of a light's emission. */
export const UNITS: Record<LightKind, string> = {
  point: "W/sr",
  spot: "W/sr",
  directional: "W/m²",
  rectangle: "W/sr/m²",
  disc: "W/sr/m²",
  sphere: "W/sr/m²",
  tube: "W/sr/m²",
  mesh: "W/sr/m²",
  points: "W/sr",
  panels: "W/sr/m²",
  directionals: "W/m²",
  surfaces: "W/sr/m²",
};

/** The clicked surface point, and the brightness of the image. */
export interface ClickedSurface {
  position: Triple;
  /** Unit vector, towards the camera. */
  normal: Triple;
  /** Distance from the camera, meters. */
  distance: number;
  /** Mean radiance of the image. */
  radiance: number;
}

const OFFSET_FRACTION = 0.2;
const SIDE_FRACTION = 0.4;
const TUBE_LENGTH_FRACTION = 1;
const TUBE_RADIUS_FRACTION = 0.02;
/** Irradiance of a new light divided by the image's mean radiance: as bright as the image on a middle gray surface. */
const BRIGHTNESS_FRACTION = 6;

/** Position of a panel, raised so that its lower edge is not below the clicked point, which may be on a floor. A panel
 * under a downward-facing surface stays there. */
function liftAboveSurface(clicked: Triple, position: Triple, direction: Triple, halfSide: number): Triple {
  const hangs = direction[1] > Math.SQRT1_2 * length(direction);
  const below = clicked[1] - (position[1] - halfSide * Math.sqrt(1 - (direction[1] / length(direction)) ** 2));
  return hangs || below <= 0 ? position : roundComponents(add(position, [0, below, 0]));
}

/** A new light for a clicked point: offset from the surface by a fraction of the camera's distance, aimed at the point,
 * and as bright as the rest of the image. */
export function createLight(kind: AddedKind, { position, normal, distance, radiance }: ClickedSurface): Light {
  const offset = distance * OFFSET_FRACTION;
  const lightPosition = roundComponents(add(position, scale(normal, offset)));
  const direction = roundComponents(subtract(position, lightPosition));
  const irradiance = BRIGHTNESS_FRACTION * (radiance > 0 ? radiance : 1);
  const gray = (value: number): Rgb => Array<number>(3).fill(Number(value.toPrecision(2))) as Rgb;
  const intensity = gray(irradiance * offset ** 2);
  switch (kind) {
    case "point":
      return { ...DEFAULT_LIGHTS.point, emission: intensity, position: lightPosition };
    case "spot":
      return { ...DEFAULT_LIGHTS.spot, emission: intensity, position: lightPosition, direction };
    case "directional":
      return {
        ...DEFAULT_LIGHTS.directional,
        emission: gray(irradiance),
        direction: roundComponents(normalize(direction)),
      };
    case "rectangle": {
      const side = Number((SIDE_FRACTION * offset).toPrecision(2));
      const emission = gray((irradiance * offset ** 2) / side ** 2);
      const raised = liftAboveSurface(position, lightPosition, direction, side / 2);
      const aim = roundComponents(subtract(position, raised));
      return { ...DEFAULT_LIGHTS.rectangle, emission, position: raised, direction: aim, size: [side, side] };
    }
    case "disc":
    case "sphere": {
      const radius = Number(((SIDE_FRACTION / 2) * offset).toPrecision(2));
      const emission = gray((irradiance * offset ** 2) / (Math.PI * radius ** 2));
      const raised = liftAboveSurface(position, lightPosition, direction, radius);
      const aim = roundComponents(subtract(position, raised));
      return kind === "disc"
        ? { ...DEFAULT_LIGHTS.disc, emission, position: raised, direction: aim, radius }
        : { ...DEFAULT_LIGHTS.sphere, emission, position: raised, radius };
    }
    case "tube": {
      const [tubeLength, radius] = [TUBE_LENGTH_FRACTION, TUBE_RADIUS_FRACTION].map((fraction) =>
        Number((fraction * offset).toPrecision(2)),
      ) as [number, number];
      const emission = gray((irradiance * offset ** 2) / (2 * radius * tubeLength));
      return { ...DEFAULT_LIGHTS.tube, emission, position: lightPosition, radius, length: tubeLength };
    }
  }
}

/** The first unused name of "Spot", "Spot 2", …; after "Key 2" comes "Key 3". */
export function nextLightName(like: string, usedNames: readonly string[]): string {
  if (!usedNames.includes(like) && !RESERVED_LIGHT_NAMES.includes(like)) return like;
  const stem = like.replace(/ \d+$/, "").slice(0, MAX_LIGHT_NAME - 4);
  let n = 2;
  while (usedNames.includes(`${stem} ${n}`)) n += 1;
  return `${stem} ${n}`;
}

/** Why a light, or a group of lights, cannot be renamed so; null if it can. */
export function nameProblem(kind: "light" | "light group", name: string, used: object): string | null {
  if (RESERVED_LIGHT_NAMES.includes(name)) return `“${name}” is reserved. Use another name.`;
  return Object.hasOwn(used, name) ? `A ${kind} named “${name}” already exists.` : null;
}

const COPY_OFFSET = 0.25;

/** A copy of a light, offset so that the handles do not coincide. */
export function offsetCopy(light: Light): Light {
  if (!("position" in light)) return { ...light };
  const reach = isAimed(light) ? length(light.direction) : 1;
  return { ...light, position: roundComponents(add(light.position, [COPY_OFFSET * Math.max(reach, 0.1), 0, 0])) };
}

/** A complete light from a partial one; missing fields come from `base`, or else from the defaults. */
export function completeLight(partial: Partial<Light>, base: Light | undefined): Light {
  const kind = partial.kind ?? base?.kind ?? "point";
  return { ...(base?.kind === kind ? base : DEFAULT_LIGHTS[kind]), ...partial } as Light;
}

/** The light as another kind, keeping shared fields. */
export function changeKind(light: Light, kind: AddedKind): Light {
  const start = DEFAULT_LIGHTS[kind];
  const shared = Object.entries(light).filter(([field]) => field !== "kind" && field in start);
  return { ...start, ...Object.fromEntries(shared) };
}
