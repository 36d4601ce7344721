/** How strong a light is as a whole: in watts, and as cameras count it.
 *
 * relume's light is radiometric; 683 lumens are a watt, as in imported files. Of R, G and B the luminance counts. */
import { luminance } from "../../render/color/tonemap";
import type { Light, Rgb } from "../../protocol";

export const LUMENS_PER_WATT = 683;

/** Units of a light's whole: as energy, and as cameras count it. */
export interface PhotometricUnits {
  label: string;
  watts: string;
  lumens: string;
}

const POWER: PhotometricUnits = { label: "Power", watts: "W", lumens: "lm" };
/** Light from far away has no power; it has what it gives a surface that faces it. */
const IRRADIANCE: PhotometricUnits = { label: "On a surface that faces it", watts: "W/m²", lumens: "lx" };
/** How large the surfaces are is the scene's. */
const RADIANCE: PhotometricUnits = { label: "Radiance", watts: "W/sr/m²", lumens: "cd/m²" };

export function unitsOf(light: Light): PhotometricUnits {
  if (light.kind === "directional") return IRRADIANCE;
  return light.kind === "mesh" ? RADIANCE : POWER;
}

const cosine = (degrees: number) => Math.cos((degrees * Math.PI) / 180);

/** What emission is multiplied by to have the whole: the directions it goes to, and the surface it comes from. */
function emittingExtent(light: Light): number {
  switch (light.kind) {
    case "point":
      return 4 * Math.PI;
    case "spot": {
      // between its two angles the light falls as the square of a ramp over the cosine, a third of which is full
      const [full, edge] = [cosine(light.cone[0]), cosine(light.cone[1])];
      return 2 * Math.PI * (1 - full + (full - edge) / 3);
    }
    case "rectangle":
      return Math.PI * light.size[0] * light.size[1];
    default:
      return 1;
  }
}

/** Watts of a light as it is now: with its intensity and tint, whether it is on or not. */
export function wattsOf(light: Light): number {
  const emittedRadiance = light.emission.map((value, channel) => value * light.intensity * (light.color[channel] as number)) as Rgb;
  return luminance(emittedRadiance) * emittingExtent(light);
}

/** The emission with which a light has so many watts; null where its intensity or tint leaves nothing of any. */
export function emissionForWatts(light: Light, watts: number): Rgb | null {
  const currentWatts = wattsOf(light);
  const white: Light = { ...light, emission: [1, 1, 1] };
  const base = currentWatts > 0 ? light : white;
  const factor = watts / (currentWatts > 0 ? currentWatts : wattsOf(white));
  if (!Number.isFinite(factor)) return null;
  return base.emission.map((value) => Number((value * factor).toPrecision(6))) as Rgb;
}
