/** Custom bake recipes: limits, aspect ratios, and the matching preview. */
export type BakeSize = [width: number, height: number];

/** The server's limits. */
export const SIDE_RANGE = { minimum: 16, maximum: 16384 };
export const LIGHTS_RANGE = { minimum: 1, maximum: 100_000 };
export const PATCHES_RANGE = { minimum: 64, maximum: 65_535 };
export const GATHER_RAYS_RANGE = { minimum: 16, maximum: 4096 };
export const PREVIEW_PIXELS = 320 * 240;

export interface CustomBakeRecipe {
  size: BakeSize;
  lights: number;
  /** Surface patches for indirect light, and gather rays; unset: chosen by the method. */
  patches?: number;
  gather_rays?: number;
}

/** A preview's size with the same aspect ratio: about as many pixels as the preset's, never more than requested. */
export function previewSize([width, height]: BakeSize): BakeSize {
  const factor = Math.min(1, Math.sqrt(PREVIEW_PIXELS / (width * height)));
  return [Math.max(1, Math.round(width * factor)), Math.max(1, Math.round(height * factor))];
}

/** An aspect ratio and its label. */
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
/** The server's limits. */
const ASPECT_RANGE = { minimum: 0.125, maximum: 8 };

/** The aspect ratios to choose from, with the camera's first if it is not a standard one; and the camera's own. */
export function aspectChoicesFor(cameraAspect: number): { shapes: readonly AspectChoice[]; selected: AspectChoice } {
  const standard = STANDARD_ASPECTS.find(({ aspect }) => Math.abs(aspect / cameraAspect - 1) < ASPECT_TOLERANCE);
  if (standard !== undefined) return { shapes: STANDARD_ASPECTS, selected: standard };
  const aspect = Math.min(ASPECT_RANGE.maximum, Math.max(ASPECT_RANGE.minimum, cameraAspect));
  const initial = { label: `${Number(aspect.toFixed(2))}:1`, aspect };
  return { shapes: [initial, ...STANDARD_ASPECTS], selected: initial };
}

/** A size with another aspect ratio and about as many pixels. */
export function resizeToAspect([width, height]: BakeSize, aspect: number): BakeSize {
  const newWidth = Math.max(1, Math.round(Math.sqrt(width * height * aspect)));
  return [newWidth, Math.max(1, Math.round(newWidth / aspect))];
}

const isIntegerInRange = (value: number, { minimum, maximum }: { minimum: number; maximum: number }) =>
  Number.isInteger(value) && value >= minimum && value <= maximum;

const isUnsetOrInRange = (value: number | undefined, range: { minimum: number; maximum: number }) =>
  value === undefined || isIntegerInRange(value, range);

const rangeText = ({ minimum, maximum }: { minimum: number; maximum: number }) =>
  `${minimum}–${maximum.toLocaleString("en")}`;

/** Error message of a recipe; null if valid. */
export function validateRecipe({ size, lights, patches, gather_rays }: CustomBakeRecipe): string | null {
  if (!size.every((side) => isIntegerInRange(side, SIDE_RANGE)))
    return `Enter a width and height in pixels (${rangeText(SIDE_RANGE)}).`;
  if (!isIntegerInRange(lights, LIGHTS_RANGE)) return `Enter an environment detail of ${rangeText(LIGHTS_RANGE)}.`;
  if (!isUnsetOrInRange(patches, PATCHES_RANGE))
    return `Enter ${rangeText(PATCHES_RANGE)} bounce samples, or leave empty for auto.`;
  if (!isUnsetOrInRange(gather_rays, GATHER_RAYS_RANGE))
    return `Enter ${rangeText(GATHER_RAYS_RANGE)} rays per sample, or leave empty for auto.`;
  return null;
}
