/** Custom recipes: sizes, and the preview that goes before one. */
export type BakeSize = [width: number, height: number];

/** The server takes no others. */
export const SIDE_RANGE = { minimum: 16, maximum: 16384 };
export const LIGHTS_RANGE = { minimum: 1, maximum: 100_000 };
export const PATCHES_RANGE = { minimum: 64, maximum: 65_535 };
export const GATHER_RAYS_RANGE = { minimum: 16, maximum: 4096 };
export const PREVIEW_PIXELS = 320 * 240;

export interface CustomBakeRecipe {
  size: BakeSize;
  lights: number;
  /** Surface patches for indirect light, and gather rays; without a number the method chooses. */
  patches?: number;
  gather_rays?: number;
}

/** A size of the same shape that a preview can have: about as many pixels as the preset's, never more than asked. */
export function previewSize([width, height]: BakeSize): BakeSize {
  const factor = Math.min(1, Math.sqrt(PREVIEW_PIXELS / (width * height)));
  return [Math.max(1, Math.round(width * factor)), Math.max(1, Math.round(height * factor))];
}

/** An image's shape: width ÷ height, and how it is called. */
export interface AspectChoice {
  label: string;
  aspect: number;
}

const STANDARD_ASPECTS: readonly AspectChoice[] = [
  { label: "4:3", aspect: 4 / 3 },
  { label: "16:9", aspect: 16 / 9 },
  { label: "1:1", aspect: 1 },
  { label: "4:5", aspect: 4 / 5 },
];
const ASPECT_TOLERANCE = 0.01;
/** The server takes no others. */
const ASPECT_RANGE = { minimum: 0.125, maximum: 8 };

/** The shapes to choose from, a camera's own first where it is none of the usual ones; and which one that camera has. */
export function aspectChoicesFor(cameraAspect: number): { shapes: readonly AspectChoice[]; selected: AspectChoice } {
  const standard = STANDARD_ASPECTS.find(({ aspect }) => Math.abs(aspect / cameraAspect - 1) < ASPECT_TOLERANCE);
  if (standard !== undefined) return { shapes: STANDARD_ASPECTS, selected: standard };
  const aspect = Math.min(ASPECT_RANGE.maximum, Math.max(ASPECT_RANGE.minimum, cameraAspect));
  const initial = { label: `${Number(aspect.toFixed(2))}:1`, aspect };
  return { shapes: [initial, ...STANDARD_ASPECTS], selected: initial };
}

/** About as many pixels in another shape. */
export function resizeToAspect([width, height]: BakeSize, aspect: number): BakeSize {
  const newWidth = Math.max(1, Math.round(Math.sqrt(width * height * aspect)));
  return [newWidth, Math.max(1, Math.round(newWidth / aspect))];
}

const isIntegerInRange = (value: number, { minimum, maximum }: { minimum: number; maximum: number }) =>
  Number.isInteger(value) && value >= minimum && value <= maximum;

const isUnsetOrInRange = (value: number | undefined, range: { minimum: number; maximum: number }) => value === undefined || isIntegerInRange(value, range);

const rangeText = ({ minimum, maximum }: { minimum: number; maximum: number }) => `${minimum} to ${maximum.toLocaleString("en")}`;

/** The error message of a recipe; null if it is valid. */
export function validateRecipe({ size, lights, patches, gather_rays }: CustomBakeRecipe): string | null {
  if (!size.every((side) => isIntegerInRange(side, SIDE_RANGE))) return `Give width and height in whole pixels, ${rangeText(SIDE_RANGE)}.`;
  if (!isIntegerInRange(lights, LIGHTS_RANGE)) return `Give ${rangeText(LIGHTS_RANGE)} light triangles.`;
  if (!isUnsetOrInRange(patches, PATCHES_RANGE)) return `Give ${rangeText(PATCHES_RANGE)} patches, or none: as many as fit.`;
  if (!isUnsetOrInRange(gather_rays, GATHER_RAYS_RANGE)) return `Give ${rangeText(GATHER_RAYS_RANGE)} rays a sample, or none: as many as fit.`;
  return null;
}
