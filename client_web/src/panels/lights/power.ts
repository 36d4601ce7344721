/** Total power of a light and radiance of its surface, radiometric and photometric.
 *
 * relume's light is radiometric; 683 lm are 1 W, as in imported files. RGB values count by their luminance. */
import { luminance } from "../../render/color/tonemap";
import type { Light, Rgb } from "../../protocol";

export const LUMENS_PER_WATT = 683;

/** Radiometric and photometric units of a light's brightness. */
export interface PhotometricUnits {
  label: string;
  watts: string;
  lumens: string;
}

const POWER: PhotometricUnits = { label: "Power", watts: "W", lumens: "lm" };
/** Directional lights have no power, but an irradiance on a perpendicular surface. */
const IRRADIANCE: PhotometricUnits = { label: "Illuminance", watts: "W/m²", lumens: "lx" };
const MEAN_IRRADIANCE: PhotometricUnits = { ...IRRADIANCE, label: "Mean illuminance" };
/** For many lights as one source, whose number belongs to the scene. */
const INTENSITY: PhotometricUnits = { label: "Mean intensity", watts: "W/sr", lumens: "cd" };
/** For lights with an IES file or a gobo: as data sheets state it. */
const PEAK_INTENSITY: PhotometricUnits = { label: "Peak intensity", watts: "W/sr", lumens: "cd" };
/** For surfaces; the only one for emissive meshes and many area lights, whose area belongs to the scene. A nit is 1 cd/m². */
const RADIANCE: PhotometricUnits = { label: "Luminance", watts: "W/sr/m²", lumens: "cd/m²" };

/** A quantity that can be typed. `perWatt`: its value for each watt of `wattsOf`. */
export interface Quantity extends PhotometricUnits {
  perWatt: number;
}

/** The quantities of a light's brightness. */
export function quantitiesOf(light: Light): Quantity[] {
  const units = unitsOf(light);
  const quantity = { ...units, perWatt: 1 };
  return units === POWER && isSurface(light)
    ? [quantity, { ...RADIANCE, perWatt: 1 / emittingExtent(light) }]
    : [quantity];
}

function unitsOf(light: Light): PhotometricUnits {
  if (isShaped(light)) return PEAK_INTENSITY;
  switch (light.kind) {
    case "directional":
      return IRRADIANCE;
    case "directionals":
      return MEAN_IRRADIANCE;
    case "points":
      return INTENSITY;
    case "mesh":
    case "panels":
    case "surfaces":
      return RADIANCE;
    default:
      return POWER;
  }
}

const isSurface = ({ kind }: Light) => ["rectangle", "disc", "sphere", "tube"].includes(kind);

/** True for a light with an IES file or a gobo: its power depends on it. */
const isShaped = (light: Light) =>
  ("profile" in light && light.profile != null) || ("gobo" in light && light.gobo != null);

const cosine = (degrees: number) => Math.cos((degrees * Math.PI) / 180);

/** Factor from emission to power: the integral over directions and area. */
function emittingExtent(light: Light): number {
  if (isShaped(light)) return 1;
  switch (light.kind) {
    case "point":
      return 4 * Math.PI;
    case "spot": {
      // between its two angles the light falls off as the square of a linear ramp over the cosine, whose mean is 1/3
      const [full, edge] = [cosine(light.cone[0]), cosine(light.cone[1])];
      return 2 * Math.PI * (1 - full + (full - edge) / 3);
    }
    case "rectangle":
      return Math.PI * light.size[0] * light.size[1];
    case "disc":
      return Math.PI ** 2 * light.radius ** 2;
    case "sphere":
      return 4 * Math.PI ** 2 * light.radius ** 2;
    case "tube":
      return 2 * Math.PI ** 2 * light.radius * light.length;
    default:
      return 1;
  }
}

/** Power of a light in watts, with intensity and tint, whether it is on or off. */
export function wattsOf(light: Light): number {
  const emittedRadiance = light.emission.map(
    (value, channel) => value * light.intensity * (light.color[channel] as number),
  ) as Rgb;
  return luminance(emittedRadiance) * emittingExtent(light);
}

/** The emission for a power in watts; null if intensity or tint are zero. */
export function emissionForWatts(light: Light, watts: number): Rgb | null {
  const currentWatts = wattsOf(light);
  const white: Light = { ...light, emission: [1, 1, 1] };
  const base = currentWatts > 0 ? light : white;
  const factor = watts / (currentWatts > 0 ? currentWatts : wattsOf(white));
  if (!Number.isFinite(factor)) return null;
  return base.emission.map((value) => Number((value * factor).toPrecision(6))) as Rgb;
}
