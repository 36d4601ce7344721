/** Links of a light: the surfaces that it lights, or that cast its shadows. */
import type { ExcludeLink, IncludeLink } from "../../look.gen";
import type { Light } from "../../protocol";

export type Link = IncludeLink | ExcludeLink | null;
export type LinkMode = "all" | "include" | "exclude";
export type SurfaceKind = "materials" | "objects";
export type LinkedNames = Record<SurfaceKind, readonly string[]>;

export function modeOf(link: Link): LinkMode {
  if (link === null) return "all";
  return "include" in link ? "include" : "exclude";
}

export function namesOf(link: Link): LinkedNames {
  const names = link === null ? {} : "include" in link ? link.include : link.exclude;
  return { materials: names.materials ?? [], objects: names.objects ?? [] };
}

/** The link in another mode, with the same names. */
export function linkOf(mode: LinkMode, { materials, objects }: LinkedNames): Link {
  const names = { materials: [...materials], objects: [...objects] };
  if (mode === "all") return null;
  return mode === "include" ? { include: names } : { exclude: names };
}

/** The link with a name added, or removed if it has it. */
export function toggleName(link: Link, kind: SurfaceKind, name: string): Link {
  const names = namesOf(link);
  const rest = names[kind].filter((other) => other !== name);
  const next = rest.length < names[kind].length ? rest : [...rest, name];
  return linkOf(modeOf(link), { ...names, [kind]: next });
}

export const isLinked = (light: Light) => (light.link ?? null) !== null || (light.shadow_link ?? null) !== null;

/** What a link says, for people. */
export function linkText(link: Link): string {
  const { materials, objects } = namesOf(link);
  const names = [...materials, ...objects];
  const few = names.slice(0, 2).join(", ") + (names.length > 2 ? ` and ${names.length - 2} more` : "");
  const texts = { all: "All", include: names.length === 0 ? "Nothing" : few, exclude: `All but ${few}` };
  return names.length === 0 && modeOf(link) === "exclude" ? texts.all : texts[modeOf(link)];
}
