/** The server's OpenColorIO config, and what pictures are shown by: tone maps, or tables of its views. */
import { computed, signal } from "@preact/signals";
import type { Table } from "../color/table";
import type { ShownToneMap } from "../color/tonemap";
import type { ColorBody, Look, OcioView } from "../protocol";

type ToneMap = Look["display"]["tone_map"];

export const colorConfig = signal<ColorBody | null>(null);
/** By keys of views; null: it does not work. */
export const tables = signal<ReadonlyMap<string, Table | null>>(new Map());
/** What the screens show. */
export const toneMap = signal<ShownToneMap>("agx");

/** The colour space of the config that EXR files are to be in; "": linear Rec. 709. */
export const exrSpace = signal("");
/** Those of the server's config, but for linear Rec. 709 by its name there. */
export const spaces = computed(() => colorConfig.value?.spaces.filter((name) => name !== colorConfig.value?.working) ?? []);
/** The one that is meant, null where it is Rec. 709 or this server has none of that name. */
export const exrSpaceHere = computed(() => (spaces.value.includes(exrSpace.value) ? exrSpace.value : null));

/** A tone map as text: its name, or a view as JSON. */
export const keyOf = (of: ToneMap): string => (typeof of === "string" ? of : JSON.stringify([of.display, of.view]));

export function fromKey(key: string): ToneMap {
  if (!key.startsWith("[")) return key as ToneMap;
  const [display, view] = JSON.parse(key) as [string, string];
  return { display, view };
}

/** Whether the server has a view. */
export const isHere = ({ display, view }: OcioView): boolean =>
  colorConfig.value?.displays.some((each) => each.name === display && each.views.includes(view)) ?? false;

/** What a tone map is shown by; null while it is on its way. Views that are not here, or do not work, look as AgX. */
export function tableFor(of: ToneMap): ShownToneMap | null {
  if (typeof of === "string") return of;
  if (colorConfig.value === null) return null;
  const table = isHere(of) ? tables.value.get(keyOf(of)) : null;
  return table === undefined ? null : (table ?? "agx");
}

/** The same for what cannot wait. */
export const shownBy = (of: ToneMap): ShownToneMap => tableFor(of) ?? "agx";
