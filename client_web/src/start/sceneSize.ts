/** The size of a scene as text, and doubts about its unit. */
import type { Triple } from "../protocol";

const MAX_PLAUSIBLE_M = 100;
const MIN_PLAUSIBLE_M = 0.01;

/** Two decimals; three significant digits below a meter and from a hundred meters on: "0.0123", "1,240,000". */
function formatMeters(meters: number): string {
  const isOrdinary = (meters >= 0.1 && meters < 100) || meters === 0;
  if (isOrdinary) return meters.toFixed(2);
  return meters >= 100
    ? Number(meters.toPrecision(3)).toLocaleString("en-US")
    : meters.toLocaleString("en-US", { maximumSignificantDigits: 3, maximumFractionDigits: 20 });
}

/** "2.40 × 0.85 × 1.10 m": width, height and depth. */
export function formatSize(sides: Triple): string {
  return `${sides.map(formatMeters).join(" × ")} m`;
}

/** A sentence about a size that few scenes have; null for a plausible one. */
export function sizeDoubt(sides: Triple): string | null {
  const longest = Math.max(...sides);
  if (longest > MAX_PLAUSIBLE_M)
    return `Larger than ${MAX_PLAUSIBLE_M} m: a person would be ${share(1.75 / longest)} of its longest side. Check the unit.`;
  if (longest < MIN_PLAUSIBLE_M) return "Smaller than 1 cm: it would fit on a fingertip. Check the unit.";
  return null;
}

/** A fraction below 2 % as "1/570". */
function share(fraction: number): string {
  return `1/${Number((1 / fraction).toPrecision(2)).toLocaleString("en-US")}`;
}
