/** Recipes of people's own: sizes, and the preview that goes before one. */
export type Size = [width: number, height: number];

/** The server takes no others. */
export const SIDE = { minimum: 16, maximum: 16384 };
export const LIGHTS = { minimum: 1, maximum: 100_000 };
export const PREVIEW_PIXELS = 320 * 240;

export interface OwnRecipe {
  size: Size;
  lights: number;
}

/** A size of the same shape that a preview can have: about as many pixels as the preset's, never more than asked. */
export function previewSize([width, height]: Size): Size {
  const factor = Math.min(1, Math.sqrt(PREVIEW_PIXELS / (width * height)));
  return [Math.max(1, Math.round(width * factor)), Math.max(1, Math.round(height * factor))];
}

const isWhole = (value: number, { minimum, maximum }: { minimum: number; maximum: number }) =>
  Number.isInteger(value) && value >= minimum && value <= maximum;

/** What is wrong with a recipe, in words; null where nothing is. */
export function recipeProblem({ size, lights }: OwnRecipe): string | null {
  if (!size.every((side) => isWhole(side, SIDE)))
    return `Give width and height in whole pixels, ${SIDE.minimum} to ${SIDE.maximum.toLocaleString("en")}.`;
  if (!isWhole(lights, LIGHTS)) return `Give 1 to ${LIGHTS.maximum.toLocaleString("en")} light triangles.`;
  return null;
}
