/** Warns if the summed terms of a material reflect more light than they receive. */
import { getAlbedo } from "../../session/net/api";
import type { Term } from "../../protocol";
import { isBtfTerm } from "../../state/look";
import { albedoMessage } from "./albedo";
import { useServerQuery } from "./useServerQuery";

const fetchAlbedo = (query: string) => getAlbedo(JSON.parse(query) as Term[]);

export function AlbedoInfo({ terms }: { terms: readonly Term[] }) {
  const evaluated = terms.filter((term) => !isBtfTerm(term));
  const query = evaluated.length > 0 ? JSON.stringify(evaluated) : null;
  const albedo = useServerQuery(query, fetchAlbedo);
  const message = albedo && albedoMessage(albedo);
  if (!message) return null;
  return (
    <p class="aside" role="status" title="Directional albedo of all layers, with white textures">
      {message}
    </p>
  );
}
