/** The stretch that carries `share` of a pixel's light: the narrowest run of bands, in degrees. */
export function mainStretch(bands: number[][], share = 0.8): [from: number, to: number] | null {
  const weights = (bands[0] ?? []).map((_, j) => bands.reduce((sum, channel) => sum + Math.max(0, channel[j] ?? 0), 0));
  const total = weights.reduce((a, b) => a + b, 0);
  if (!(total > 0)) return null;
  let best: [number, number] = [0, weights.length];
  let sum = 0;
  for (let a = 0, b = 0; b < weights.length; ) {
    sum += weights[b++] as number;
    while (sum - (weights[a] as number) >= share * total) sum -= weights[a++] as number;
    if (sum >= share * total && b - a < best[1] - best[0]) best = [a, b];
  }
  const width = 90 / weights.length;
  return [best[0] * width, best[1] * width];
}
