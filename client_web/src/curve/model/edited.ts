/** Edits relative to what a curve was: a factor and an offset for each band. `relume/brdf/edited.py` computes alike. */
import type { DrawnCurve, Handle } from "../../protocol";

/** edited = factors · before + offsets, band by band. */
export interface Layer {
  factors: number[];
  offsets: number[];
}

/** What an edit does to each band of a curve that is `before`; exactly one and zero where it does nothing. */
export function layerOf(drawn: DrawnCurve | null, before: readonly number[]): Layer {
  const layer = bandsLayer(drawn, before.length);
  if (drawn?.handles === undefined) return layer;
  const pulls = pullsOf(drawn.handles, applied(layer, before));
  return {
    factors: layer.factors.map((factor, j) => (pulls.factors[j] as number) * factor),
    offsets: layer.offsets.map((offset, j) => (pulls.factors[j] as number) * offset + (pulls.offsets[j] as number)),
  };
}

/** The same without its handles. */
export function bandsLayer(drawn: DrawnCurve | null, numBands: number): Layer {
  const plain = (value: number) => Array<number>(numBands).fill(value);
  const { factors = plain(1), offsets = plain(0) } = (drawn ?? {}) as Partial<Layer>;
  return { factors, offsets };
}

export function applied({ factors, offsets }: Layer, before: readonly number[]): number[] {
  return before.map((value, j) => (factors[j] as number) * value + (offsets[j] as number));
}

/** Where an angle lies among the bands' middles; the outer halves of the first and the last band belong to theirs. */
function placeOf(degrees: number, numBands: number): number {
  return Math.min(numBands - 1, Math.max(0, (degrees / 90) * numBands - 0.5));
}

/** A curve's value at an angle: linear between the bands' middles. */
export function valueOn(bands: readonly number[], degrees: number): number {
  const place = placeOf(degrees, bands.length);
  const band = Math.min(Math.floor(place), bands.length - 2);
  const [low, high] = [bands[band] ?? 0, bands[band + 1] ?? 0];
  return low + (high - low) * (place - band);
}

function pullsOf(handles: readonly Handle[], before: readonly number[]): Layer {
  const places = handles.map(([degrees]) => placeOf(degrees, before.length));
  const pulls: Layer = { factors: [], offsets: [] };
  let left = 0;
  before.forEach((value, band) => {
    while (left < handles.length - 2 && (places[left + 1] as number) <= band) left++;
    const [from, to] = [places[left] as number, places[left + 1] as number];
    const share = Math.min(1, Math.max(0, (band - from) / (to > from ? to - from : 1)));
    const right = share * share * (3 - 2 * share);
    const [a, b] = [pull(handles[left] as Handle, value), pull(handles[left + 1] as Handle, value)];
    pulls.factors.push(1 + (1 - right) * a.gain + right * b.gain);
    pulls.offsets.push((1 - right) * a.lift + right * b.lift);
  });
  return pulls;
}

/** How a handle moves a value, by gain · value + lift: lower ones in proportion, higher ones as far as itself; one that
 * more than doubles what was there adds the rest to the low ones too. */
function pull([, was, becomes]: Handle, value: number): { gain: number; lift: number } {
  const move = becomes - was;
  const rise = Math.max(move, 0);
  if (value > was) return { gain: Math.min(move, 0) / value, lift: rise };
  const reach = Math.max(was, rise) || 1;
  return { gain: move / reach, lift: (rise * Math.max(rise - was, 0)) / reach };
}

/** Where a handle brings a value. */
export function pulled(handle: Handle, value: number): number {
  const { gain, lift } = pull(handle, value);
  return value + gain * value + lift;
}
