/** The plot's axes: angle to and from fraction of the width, value to and from fraction of the height. */

export const MAX_DEGREES = 90;
const LOG_DECADES = 5;
/** Below this fraction of a logarithmic axis the value is zero. */
const LOG_ZERO = 0.004;

export interface CurveAxes {
  /** Expands small angles, where highlights are: fraction = sqrt(angle / 90°). */
  stretched: boolean;
  log: boolean;
  /** Value at the top of the plot. */
  top: number;
}

export function xFraction(axes: CurveAxes, degrees: number): number {
  const t = degrees / MAX_DEGREES;
  return axes.stretched ? Math.sqrt(Math.max(0, t)) : t;
}

export function degreesAt(axes: CurveAxes, fraction: number): number {
  const t = Math.min(1, Math.max(0, fraction));
  return MAX_DEGREES * (axes.stretched ? t * t : t);
}

export function bottomOf(axes: CurveAxes): number {
  return axes.log ? axes.top / 10 ** LOG_DECADES : 0;
}

/** 0 at the bottom, 1 at the top; may lie outside. */
export function yFraction(axes: CurveAxes, value: number): number {
  if (!axes.log) return value / axes.top;
  if (value <= 0) return 0;
  return Math.max(0, Math.log10(value / bottomOf(axes)) / LOG_DECADES);
}

export function valueAt(axes: CurveAxes, fraction: number): number {
  if (!axes.log) return Math.max(0, fraction * axes.top);
  return fraction < LOG_ZERO ? 0 : bottomOf(axes) * 10 ** (fraction * LOG_DECADES);
}

/** The next of 1, 2, 5 × 10ⁿ above the largest value plus a margin; powers of ten on a logarithmic axis. */
export function niceTop(largest: number, log: boolean): number {
  if (!(largest > 0)) return 1;
  if (log) return 10 ** Math.ceil(Math.log10(largest * 1.05));
  const target = largest * 1.08;
  const power = 10 ** Math.floor(Math.log10(target));
  const factor = [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((f) => f * power >= target) ?? 10;
  return factor * power;
}

export function xTicks(axes: CurveAxes): number[] {
  return axes.stretched ? [0, 1, 5, 10, 20, 40, 60, 90] : [0, 15, 30, 45, 60, 75, 90];
}

export function yTicks(axes: CurveAxes): number[] {
  if (axes.log) return Array.from({ length: LOG_DECADES }, (_, i) => axes.top / 10 ** i);
  return [0.25, 0.5, 0.75, 1].map((t) => t * axes.top);
}
