/** Says where the terms of a material, summed, send back more light than meets it. */
import { getAlbedo } from "../net/api";
import type { Term } from "../protocol";
import { isTexels } from "../state/look";
import { energyWords } from "./energy";
import { useTold } from "./useTold";

export function Energy({ terms }: { terms: readonly Term[] }) {
  const evaluated = terms.filter((term) => !isTexels(term));
  const asked = evaluated.length > 0 ? JSON.stringify(evaluated) : null;
  const told = useTold(asked, (text) => getAlbedo(JSON.parse(text) as Term[]));
  const words = told && energyWords(told);
  if (!words) return null;
  return (
    <p class="aside" role="status" title="Directional albedo of all terms, their images taken as white.">
      {words}
    </p>
  );
}
