/** What a view whose eye moves makes of a term: how many functions of the incoming light it takes, and what they miss. */
import { getInOut } from "../net/api";
import type { InOutBody, Term } from "../protocol";
import { materialOf } from "../state/scene";
import { moves } from "../state/views";
import { isTexels } from "../state/look";
import { drawsHere } from "../live/drawing";
import { useTold } from "./useTold";

function words({ functions, missed, needed, is_mirror }: InOutBody): string {
  const percent = missed < 0.01 ? "less than 1 %" : `${Math.round(100 * missed)} %`;
  if (is_mirror) return `While the eye moves: a blurred mirror. ${functions} terms would miss ${percent} of this highlight.`;
  const enough = needed === null || needed === functions ? "" : needed === 1 ? "; one misses less than 5 %" : `; ${needed} miss less than 5 %`;
  return `While the eye moves: ${functions} terms, which miss ${percent}${enough}.`;
}

/** How a texture that looks different from every side lies on a material, and who can draw it; null: as everywhere. */
export function coverWords(material: string): string | null {
  const isProjected = materialOf(material)?.is_projected === true;
  const said = [
    isProjected && "The object has no places in textures: it is projected along the world’s axes, a metre for each repeat.",
    moves.value && drawsHere.value && "While the eye moves: the mean of all texels, as this browser draws.",
  ].filter(Boolean);
  return said.length > 0 ? said.join(" ") : null;
}

export function InMotion({ term, material }: { term: Term; material: string }) {
  const isCover = isTexels(term);
  const asked = moves.value && !isCover ? JSON.stringify(term) : null;
  const told = useTold(asked, async (text) => (await getInOut([JSON.parse(text) as Term]))[0] ?? null);
  if (isCover) {
    const cover = coverWords(material);
    return cover === null ? null : <p class="in-motion">{cover}</p>;
  }
  if (told === null) return null;
  return (
    <p class="in-motion" title="In-out factorisation of this term, cosine-weighted RMS. Where the eye rests it is exact.">
      {words(told)}
    </p>
  );
}
