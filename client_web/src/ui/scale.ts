/** Slider scales, and number formatting. */

export interface NumberRange {
  minimum: number;
  maximum: number;
  scale: "linear" | "log";
  /** Values are multiples of this; one key press moves by it. */
  step?: number;
}

function isLog(range: NumberRange): boolean {
  return range.scale === "log" && range.minimum > 0;
}

export function clampTo(range: NumberRange, value: number): number {
  return Math.min(range.maximum, Math.max(range.minimum, value));
}

/** Slider position 0…1 of a value. */
export function toFraction(range: NumberRange, value: number): number {
  const { minimum, maximum } = range;
  const v = clampTo(range, value);
  if (isLog(range)) return Math.log(v / minimum) / Math.log(maximum / minimum);
  return maximum > minimum ? (v - minimum) / (maximum - minimum) : 0;
}

/** Value at a position, rounded to three significant digits of the slider's own resolution. */
export function fromFraction(range: NumberRange, fraction: number): number {
  const t = Math.min(1, Math.max(0, fraction));
  const { minimum, maximum } = range;
  const value = isLog(range) ? minimum * (maximum / minimum) ** t : minimum + (maximum - minimum) * t;
  return snap(range, roundToStep(value, isLog(range) ? value : maximum - minimum));
}

/** The nearest value of the range. */
export function snap(range: NumberRange, value: number): number {
  return clampTo(range, range.step === undefined ? value : Math.round(value / range.step) * range.step);
}

/** Fraction of the slider's length per key press. */
export function keyStep({ minimum, maximum, step = 0 }: NumberRange): number {
  return Math.max(0.01, step / (maximum - minimum));
}

/** Round to a thousandth of `span`, to a power of ten. */
function roundToStep(value: number, span: number): number {
  if (!(span > 0)) return value;
  const step = 10 ** (Math.floor(Math.log10(span)) - 3);
  return Number((Math.round(value / step) * step).toPrecision(12));
}

/** A number for reading: four significant digits, no trailing noise. */
export function formatNumber(value: number): string {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(2).replace("e+", "e");
  if (size >= 1000) return value.toFixed(0);
  if (size >= 100) return value.toFixed(1);
  if (size >= 10) return value.toFixed(2);
  return value.toFixed(3);
}

/** A round number on an axis, without trailing zeros. */
export function tickLabel(value: number): string {
  const rounded = Number(value.toPrecision(3));
  return rounded >= 1e5 ? rounded.toExponential().replace("e+", "e") : String(rounded);
}

/** Parse a typed number with point or comma; null if invalid. */
export function parseNumber(text: string): number | null {
  const cleaned = text.trim().replace(",", ".");
  if (cleaned === "") return null;
  const value = Number(cleaned);
  return Number.isFinite(value) ? value : null;
}

export function formatBytes(bytes: number): string {
  if (bytes >= 1e9) return `${(bytes / 1e9).toFixed(1)} GB`;
  if (bytes >= 1e6) return `${(bytes / 1e6).toFixed(bytes >= 1e7 ? 0 : 1)} MB`;
  return `${Math.max(1, Math.round(bytes / 1e3))} kB`;
}

/** Seconds as text: "under a second", "12 s", "3 min". */
export function formatSeconds(seconds: number): string {
  if (seconds < 1) return "under a second";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

/** An estimated duration: "under a second", "about 12 s". */
export function formatEstimatedTime(seconds: number): string {
  return seconds < 1 ? formatSeconds(seconds) : `about ${formatSeconds(seconds)}`;
}

export function formatCount(count: number): string {
  if (count >= 1e9) return `${(count / 1e9).toFixed(1)} billion`;
  if (count >= 1e6) return `${(count / 1e6).toFixed(count >= 1e8 ? 0 : 1)} million`;
  return count.toLocaleString("en");
}
