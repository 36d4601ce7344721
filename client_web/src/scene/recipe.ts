/** Recipes of people's own: sizes, and the preview that goes before one. */
export type Size = [width: number, height: number];

/** The server takes no others. */
export const SIDE = { minimum: 16, maximum: 16384 };
export const LIGHTS = { minimum: 1, maximum: 100_000 };
export const GATHER_SAMPLES = { minimum: 64, maximum: 65_535 };
export const GATHER_RAYS = { minimum: 16, maximum: 4096 };
export const PREVIEW_PIXELS = 320 * 240;

export interface OwnRecipe {
  size: Size;
  lights: number;
  /** Pieces of surfaces that light each other, and rays that look for them; without a number the method chooses. */
  gather_samples?: number;
  gather_rays?: number;
}

/** A size of the same shape that a preview can have: about as many pixels as the preset's, never more than asked. */
export function previewSize([width, height]: Size): Size {
  const factor = Math.min(1, Math.sqrt(PREVIEW_PIXELS / (width * height)));
  return [Math.max(1, Math.round(width * factor)), Math.max(1, Math.round(height * factor))];
}

/** A picture's shape: width ÷ height, and how it is called. */
export interface Shape {
  label: string;
  aspect: number;
}

const SHAPES: readonly Shape[] = [
  { label: "4:3", aspect: 4 / 3 },
  { label: "16:9", aspect: 16 / 9 },
  { label: "1:1", aspect: 1 },
  { label: "4:5", aspect: 4 / 5 },
];
const ALIKE = 0.01;
/** The server takes no others. */
const ASPECT = { minimum: 0.125, maximum: 8 };

/** The shapes to choose from, a camera's own first where it is none of the usual ones; and which one that camera has. */
export function shapesFor(own: number): { shapes: readonly Shape[]; chosen: Shape } {
  const usual = SHAPES.find(({ aspect }) => Math.abs(aspect / own - 1) < ALIKE);
  if (usual !== undefined) return { shapes: SHAPES, chosen: usual };
  const aspect = Math.min(ASPECT.maximum, Math.max(ASPECT.minimum, own));
  const chosen = { label: `${Number(aspect.toFixed(2))}:1`, aspect };
  return { shapes: [chosen, ...SHAPES], chosen };
}

/** About as many pixels in another shape. */
export function reshaped([width, height]: Size, aspect: number): Size {
  const wide = Math.max(1, Math.round(Math.sqrt(width * height * aspect)));
  return [wide, Math.max(1, Math.round(wide / aspect))];
}

const isWhole = (value: number, { minimum, maximum }: { minimum: number; maximum: number }) =>
  Number.isInteger(value) && value >= minimum && value <= maximum;

const anyOrWhole = (value: number | undefined, range: { minimum: number; maximum: number }) => value === undefined || isWhole(value, range);

const told = ({ minimum, maximum }: { minimum: number; maximum: number }) => `${minimum} to ${maximum.toLocaleString("en")}`;

/** What is wrong with a recipe, in words; null where nothing is. */
export function recipeProblem({ size, lights, gather_samples, gather_rays }: OwnRecipe): string | null {
  if (!size.every((side) => isWhole(side, SIDE))) return `Give width and height in whole pixels, ${told(SIDE)}.`;
  if (!isWhole(lights, LIGHTS)) return `Give ${told(LIGHTS)} light triangles.`;
  if (!anyOrWhole(gather_samples, GATHER_SAMPLES)) return `Give ${told(GATHER_SAMPLES)} gather samples, or none: as many as fit.`;
  if (!anyOrWhole(gather_rays, GATHER_RAYS)) return `Give ${told(GATHER_RAYS)} rays a sample, or none: as many as fit.`;
  return null;
}
