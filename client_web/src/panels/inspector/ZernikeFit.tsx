/** Fit of a term in the Zernike basis that free-camera views use: number of functions, and residual. */
import { getInOut } from "../../session/net/api";
import type { ZernikeFitBody, Term } from "../../protocol";
import { materialOf } from "../../state/scene";
import { hasFreeCamera } from "../../state/views";
import { isBtfTerm } from "../../state/look";
import { isClientRendering } from "../../session/clientRendering";
import { useServerQuery } from "./useServerQuery";

function fitMessage({ functions, residual, required_functions, is_mirror }: ZernikeFitBody): string {
  const percent = residual < 0.01 ? "less than 1 %" : `${Math.round(100 * residual)} %`;
  if (is_mirror) return "Drawn as a blurred mirror while the camera moves.";
  const enough = required_functions === null || required_functions === functions ? "" : required_functions === 1 ? "; 1 is enough for under 5 %" : `; under 5 % needs ${required_functions}`;
  return `While the camera moves: error ${percent} with ${functions} basis functions${enough}.`;
}

/** Notes about the BTF or tri-planar mapping of a material; null without any. */
export function coverText(material: string): string | null {
  const isProjected = materialOf(material)?.is_projected === true;
  const sentences = [
    isProjected && "The object has no UVs: the texture is projected along the world axes (tri-planar, 1 m per repeat).",
    hasFreeCamera.value && isClientRendering.value && "While the camera moves, this browser draws the average of all texels.",
  ].filter(Boolean);
  return sentences.length > 0 ? sentences.join(" ") : null;
}

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
