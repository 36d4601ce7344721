/** Message if a material's albedo exceeds 1. */
import type { AlbedoBody } from "../../protocol";

const MIN_REPORTED = 1.02; // exceeds the quadrature error

function formatPercent(fraction: number): string {
  return fraction < 10 ? `${Math.round(100 * fraction)} %` : `${Math.round(fraction).toLocaleString("en")}×`;
}

export function albedoMessage({ mean, max: maximum, max_angle_degrees: angle }: AlbedoBody): string | null {
  if (maximum <= MIN_REPORTED) return null;
  const onAverage = formatPercent(Math.max(...mean));
  return `Reflects more light than it receives (${formatPercent(maximum)} at ${Math.round(angle)}°, ${onAverage} on average). Not physically possible.`;
}
