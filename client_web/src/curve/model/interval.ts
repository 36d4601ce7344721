/** Fractions of a pixel's light below this are rounding errors. */
const NOTHING = 1e-4;

/** Fraction of a pixel's radiance that depends on a curve, 0…1. */
export function outputShares(bands: number[][], radiance: readonly number[]): number {
  const total = radiance.reduce((a, b) => a + b, 0);
  const through = bands.flat().reduce((a, b) => a + Math.max(0, b), 0);
  return total > 0 && through > NOTHING * total ? Math.min(1, through / total) : 0;
}

/** The narrowest interval of bands, in degrees, with `fraction` of a pixel's light. */
export function mainInterval(bands: number[][], fraction = 0.8): [from: number, to: number] | null {
  const weights = (bands[0] ?? []).map((_, j) => bands.reduce((sum, channel) => sum + Math.max(0, channel[j] ?? 0), 0));
  const total = weights.reduce((a, b) => a + b, 0);
  if (!(total > 0)) return null;
  let best: [number, number] = [0, weights.length];
  let sum = 0;
  for (let a = 0, b = 0; b < weights.length;) {
    sum += weights[b++] as number;
    while (sum - (weights[a] as number) >= fraction * total) sum -= weights[a++] as number;
    if (sum >= fraction * total && b - a < best[1] - best[0]) best = [a, b];
  }
  const width = 90 / weights.length;
  return [best[0] * width, best[1] * width];
}
