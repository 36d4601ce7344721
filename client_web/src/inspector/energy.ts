/** Whether a material sends back more light than meets it, in words. */
import type { AlbedoBody } from "../protocol";

const NOTICED = 1.02; // what is found by quadrature may be off by less than that

function percent(share: number): string {
  return `${Math.round(100 * share)} %`;
}

export function energyWords({ mean, most, at_deg: angle }: AlbedoBody): string | null {
  if (most <= NOTICED) return null;
  const onAverage = percent(Math.max(...mean));
  return `Sends back more light than meets it: ${percent(most)} of it ${Math.round(angle)}° from the normal, ${onAverage} on average. No real surface does.`;
}
