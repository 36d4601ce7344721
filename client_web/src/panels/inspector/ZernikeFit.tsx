/** What a view with a free camera makes of a term: how many functions of the incoming light it takes, and what they miss. */
import { getInOut } from "../../session/net/api";
import type { ZernikeFitBody, Term } from "../../protocol";
import { materialOf } from "../../state/scene";
import { hasFreeCamera } from "../../state/views";
import { isBtfTerm } from "../../state/look";
import { isClientRendering } from "../../session/clientRendering";
import { useServerQuery } from "./useServerQuery";

function fitMessage({ functions, residual, required_functions, is_mirror }: ZernikeFitBody): string {
  const percent = residual < 0.01 ? "less than 1 %" : `${Math.round(100 * residual)} %`;
  if (is_mirror) return `While the eye moves: a blurred mirror. ${functions} terms would miss ${percent} of this highlight.`;
  const enough = required_functions === null || required_functions === functions ? "" : required_functions === 1 ? "; one misses less than 5 %" : `; ${required_functions} miss less than 5 %`;
  return `While the eye moves: ${functions} terms, which miss ${percent}${enough}.`;
}

/** How a texture that looks different from every side lies on a material, and who can draw it; null: as everywhere. */
export function coverText(material: string): string | null {
  const isProjected = materialOf(material)?.is_projected === true;
  const sentences = [
    isProjected && "The object has no places in textures: it is projected along the world’s axes, a metre for each repeat.",
    hasFreeCamera.value && isClientRendering.value && "While the eye moves: the mean of all texels, as this browser draws.",
  ].filter(Boolean);
  return sentences.length > 0 ? sentences.join(" ") : null;
}

export function ZernikeFit({ term, material }: { term: Term; material: string }) {
  const isCover = isBtfTerm(term);
  const query = hasFreeCamera.value && !isCover ? JSON.stringify(term) : null;
  const fit = useServerQuery(query, async (text) => (await getInOut([JSON.parse(text) as Term]))[0] ?? null);
  if (isCover) {
    const cover = coverText(material);
    return cover === null ? null : <p class="in-motion">{cover}</p>;
  }
  if (fit === null) return null;
  return (
    <p class="in-motion" title="In-out factorisation of this term, cosine-weighted RMS. Where the eye rests it is exact.">
      {fitMessage(fit)}
    </p>
  );
}
