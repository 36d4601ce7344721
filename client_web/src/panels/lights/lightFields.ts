/** Numeric and angle fields of a light in the inspector: label, range and changes. */
import { RANGES } from "../../look.gen";
import type { Light, Triple } from "../../protocol";
import { directionFrom, sunPosition } from "./sunPosition";
import { length } from "./vector";

type Spot = Extract<Light, { kind: "spot" }>;
type Sun = Extract<Light, { kind: "directional" }>;
type Rectangle = Extract<Light, { kind: "rectangle" }>;

/** A few numbers on one line. */
export interface NumbersField {
  field: "position" | "direction" | "size" | "radius" | "length";
  editLabel: string;
  label: string;
  unit: string;
  /** Label of each number. */
  names: readonly string[];
  minimum: number;
  maximum: number;
  step: number;
  /** True if a light may have these numbers; others are rejected. */
  allows?: (values: number[]) => boolean;
}

const XYZ = ["x", "y", "z"];

const NUMBERS: readonly NumbersField[] = [
  {
    field: "position",
    editLabel: "Move",
    label: "Position",
    unit: "m",
    names: XYZ,
    ...RANGES.light.position,
    step: 0.01,
  },
  {
    field: "direction",
    editLabel: "Aim",
    label: "Direction",
    unit: "",
    names: XYZ,
    ...RANGES.light.direction,
    step: 0.05,
    allows: (values) => length(values as Triple) > 0,
  },
  {
    field: "size",
    editLabel: "Size",
    label: "Size",
    unit: "m",
    names: ["width", "height"],
    ...RANGES.light.size,
    step: 0.01,
  },
  {
    field: "radius",
    editLabel: "Size",
    label: "Radius",
    unit: "m",
    names: ["r"],
    ...RANGES.light.radius,
    step: 0.01,
  },
  {
    field: "length",
    editLabel: "Size",
    label: "Length",
    unit: "m",
    names: ["l"],
    ...RANGES.light.length,
    step: 0.01,
  },
];

/** At 90° the azimuth would be lost. */
const MAX_ELEVATION = 89.9;

/** An angle in degrees, for the kinds of light that have its field. */
export interface AngleField {
  field: "rotation" | "cone" | "angle" | "direction";
  /** The only kind of light with it, if others have the field, too. */
  kind?: Light["kind"];
  editLabel: string;
  label: string;
  minimum: number;
  maximum: number;
  valueOf: (light: Light) => number;
  /** The field's value for an angle. */
  changeFor: (light: Light, angle: number) => unknown;
}

const cone = (light: Light) => (light as Spot).cone;

const ANGLES: readonly AngleField[] = [
  {
    field: "direction",
    kind: "directional",
    editLabel: "Aim",
    label: "Azimuth",
    minimum: -180,
    maximum: 180,
    valueOf: (light) => sunPosition((light as Sun).direction).azimuth,
    changeFor: (light, azimuth) => directionFrom({ ...sunPosition((light as Sun).direction), azimuth }),
  },
  {
    field: "direction",
    kind: "directional",
    editLabel: "Aim",
    label: "Elevation",
    minimum: -MAX_ELEVATION,
    maximum: MAX_ELEVATION,
    valueOf: (light) => sunPosition((light as Sun).direction).elevation,
    changeFor: (light, elevation) => directionFrom({ ...sunPosition((light as Sun).direction), elevation }),
  },
  {
    field: "angle",
    editLabel: "Angle",
    label: "Angle",
    ...RANGES.light.angle,
    valueOf: (light) => (light as Sun).angle,
    changeFor: (_, angle) => angle,
  },
  {
    field: "rotation",
    editLabel: "Rotate",
    label: "Rotation",
    minimum: -180,
    maximum: 180,
    valueOf: (light) => (light as Rectangle).rotation,
    changeFor: (_, angle) => angle,
  },
  {
    field: "cone",
    editLabel: "Cone",
    label: "Inner cone",
    ...RANGES.light.cone,
    valueOf: (light) => cone(light)[0],
    changeFor: (light, angle) => [angle, Math.max(angle, cone(light)[1])],
  },
  {
    field: "cone",
    editLabel: "Cone",
    label: "Outer cone",
    minimum: 1,
    maximum: RANGES.light.cone.maximum,
    valueOf: (light) => cone(light)[1],
    changeFor: (light, angle) => [Math.min(cone(light)[0], angle), angle],
  },
];

/** True if a field of a light changes its image: the frame of a point or a spot matters only with an IES file or gobo. */
function matters(light: Light, field: string): boolean {
  const isEven = "profile" in light && light.profile == null && !("gobo" in light && light.gobo != null);
  return field in light && !(isEven && (field === "rotation" || (field === "direction" && light.kind === "point")));
}

export const numbersFieldsOf = (light: Light) => NUMBERS.filter(({ field }) => matters(light, field));
export const angleFieldsOf = (light: Light) =>
  ANGLES.filter(({ field, kind }) => matters(light, field) && (kind ?? light.kind) === light.kind);
