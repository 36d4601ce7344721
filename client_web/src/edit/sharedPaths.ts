/** The same value in several selected materials. */
import { jsonPointer, pointerTokens } from "../state/document/pointer";
import type { Look, Term } from "../protocol";

/** Pointers of the value of a pointer in the other `materials`: the color or a parameter of the term of the same model,
 * counted among those of that model. None for other values, or if the pointer's material is not among them. */
export function sharedPaths(look: Look, path: string, materials: readonly string[]): string[] {
  const [table, subject, list, index, member, ...rest] = pointerTokens(path);
  if (table !== "materials" || subject === undefined || list !== "terms" || !materials.includes(subject)) return [];
  if (member !== "color" && member !== "params") return [];
  const terms = look.materials[subject]?.terms ?? [];
  const model = terms[Number(index)]?.model;
  const position = indicesOf(terms, model).indexOf(Number(index));
  return materials
    .filter((name) => name !== subject)
    .flatMap((name) => {
      const other = indicesOf(look.materials[name]?.terms ?? [], model)[position];
      return other === undefined ? [] : [jsonPointer(table, name, list, other, member, ...rest)];
    });
}

function indicesOf(terms: readonly Term[], model: string | undefined): number[] {
  return terms.flatMap((term, index) => (term.model === model ? [index] : []));
}
