/** Fit of a term in the Zernike basis that free-camera views use: number of functions, and residual. */
import { getInOut } from "../../session/net/api";
import type { ZernikeFitBody, Term } from "../../protocol";
import { materialOf } from "../../state/scene";
import { hasFreeCamera } from "../../state/views";
import { isBtfTerm } from "../../state/look";
import { useServerQuery } from "./useServerQuery";

function fitMessage({ functions, residual, required_functions, is_mirror }: ZernikeFitBody): string {
  const percent = residual < 0.01 ? "less than 1 %" : `${Math.round(100 * residual)} %`;
  if (is_mirror) return "Drawn as a blurred mirror while the camera moves.";
  const enough =
    required_functions === null || required_functions === functions
      ? ""
      : required_functions === 1
        ? "; 1 is enough for under 5 %"
        : `; under 5 % needs ${required_functions}`;
  return `While the camera moves: error ${percent} with ${functions} basis functions${enough}.`;
}

/** Note about the tri-planar mapping of a material; null without. */
export const coverText = (material: string): string | null =>
  materialOf(material)?.is_projected === true
    ? "The object has no UVs: the texture is projected along the world axes (tri-planar, 1 m per repeat)."
    : null;

const fetchFit = async (query: string) => (await getInOut([JSON.parse(query) as Term]))[0] ?? null;

export function ZernikeFit({ term, material }: { term: Term; material: string }) {
  const isCover = isBtfTerm(term);
  const query = hasFreeCamera.value && !isCover ? JSON.stringify(term) : null;
  const fit = useServerQuery(query, fetchFit);
  if (isCover) {
    const cover = coverText(material);
    return cover === null ? null : <p class="in-motion">{cover}</p>;
  }
  if (fit === null) return null;
  return (
    <p class="in-motion" title="Cosine-weighted RMS error of the in-out factorization. Exact when the camera stops.">
      {fitMessage(fit)}
    </p>
  );
}
