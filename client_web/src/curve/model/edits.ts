/** Edits relative to a curve: a factor and an offset per band. Same computation as `relume/brdf/curve_edits.py`. */
import type { DrawnCurve, Handle } from "../../protocol";

/** edited = factors · before + offsets, band by band. */
export interface CurveLayer {
  factors: number[];
  offsets: number[];
}

/** Factors and offsets of an edit for each band of the curve `original`; exactly 1 and 0 in unchanged bands. */
export function layerOf(drawn: DrawnCurve | null, original: readonly number[]): CurveLayer {
  const layer = bandsLayer(drawn, original.length);
  if (drawn?.handles === undefined) return layer;
  const pulls = pullsLayer(drawn.handles, applyLayer(layer, original));
  return {
    factors: layer.factors.map((factor, j) => (pulls.factors[j] as number) * factor),
    offsets: layer.offsets.map((offset, j) => (pulls.factors[j] as number) * offset + (pulls.offsets[j] as number)),
  };
}

/** The same edit without its handles. */
export function bandsLayer(drawn: DrawnCurve | null, numBands: number): CurveLayer {
  const plain = (value: number) => Array<number>(numBands).fill(value);
  const { factors = plain(1), offsets = plain(0) } = (drawn ?? {}) as Partial<CurveLayer>;
  return { factors, offsets };
}

export function applyLayer({ factors, offsets }: CurveLayer, original: readonly number[]): number[] {
  return original.map((value, j) => (factors[j] as number) * value + (offsets[j] as number));
}

/** An angle's position between band centers; angles beyond the first and the last center are clamped to them. */
function bandPosition(degrees: number, numBands: number): number {
  return Math.min(numBands - 1, Math.max(0, (degrees / 90) * numBands - 0.5));
}

/** A curve's value at an angle: linear between band centers. */
export function sampleBands(bands: readonly number[], degrees: number): number {
  const position = bandPosition(degrees, bands.length);
  const band = Math.min(Math.floor(position), bands.length - 2);
  const [low, high] = [bands[band] ?? 0, bands[band + 1] ?? 0];
  return low + (high - low) * (position - band);
}

function pullsLayer(handles: readonly Handle[], original: readonly number[]): CurveLayer {
  const positions = handles.map(([degrees]) => bandPosition(degrees, original.length));
  const pulls: CurveLayer = { factors: [], offsets: [] };
  let left = 0;
  original.forEach((value, band) => {
    while (left < handles.length - 2 && (positions[left + 1] as number) <= band) left++;
    const [from, to] = [positions[left] as number, positions[left + 1] as number];
    const fraction = Math.min(1, Math.max(0, (band - from) / (to > from ? to - from : 1)));
    const right = fraction * fraction * (3 - 2 * fraction);
    const [a, b] = [handlePull(handles[left] as Handle, value), handlePull(handles[left + 1] as Handle, value)];
    pulls.factors.push(1 + (1 - right) * a.gain + right * b.gain);
    pulls.offsets.push((1 - right) * a.lift + right * b.lift);
  });
  return pulls;
}

/** Gain and lift of a handle, value → gain · value + lift: lower values change in proportion, higher ones by the same
 * amount; beyond a doubling, the remainder is added to low values as well. */
function handlePull([, original, target]: Handle, value: number): { gain: number; lift: number } {
  const move = target - original;
  const rise = Math.max(move, 0);
  if (value > original) return { gain: Math.min(move, 0) / value, lift: rise };
  const reach = Math.max(original, rise) || 1;
  return { gain: move / reach, lift: (rise * Math.max(rise - original, 0)) / reach };
}

/** A value after a handle's gain and lift. */
export function applyPull(handle: Handle, value: number): number {
  const { gain, lift } = handlePull(handle, value);
  return value + gain * value + lift;
}
