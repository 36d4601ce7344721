/** Message if a material's albedo exceeds 1. */
import type { AlbedoBody } from "../../protocol";

const MIN_REPORTED = 1.02; // what is found by quadrature may be off by less than that

function formatPercent(fraction: number): string {
  return `${Math.round(100 * fraction)} %`;
}

export function albedoMessage({ mean, max: maximum, max_angle_degrees: angle }: AlbedoBody): string | null {
  if (maximum <= MIN_REPORTED) return null;
  const onAverage = formatPercent(Math.max(...mean));
  return `Sends back more light than meets it: ${formatPercent(maximum)} of it ${Math.round(angle)}° from the normal, ${onAverage} on average. No real surface does.`;
}
