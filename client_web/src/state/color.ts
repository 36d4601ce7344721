/** The server's OpenColorIO config, and what images are shown by: tone maps, or tables of its views. */
import { computed, signal } from "@preact/signals";
import type { LutTable } from "../render/color/lutTable";
import type { DisplayedToneMap } from "../render/color/tonemap";
import type { ColorBody, Look, OcioView } from "../protocol";

type ToneMap = Look["display"]["tone_map"];

export const colorConfig = signal<ColorBody | null>(null);
/** By keys of views; null: it does not work. */
export const lutTables = signal<ReadonlyMap<string, LutTable | null>>(new Map());
/** What the screens show. */
export const toneMap = signal<DisplayedToneMap>("agx");

/** The color space of the config that EXR files are to be in; "": linear Rec. 709. */
export const exrSpace = signal("");
/** Those of the server's config, but for linear Rec. 709 by its name there. */
export const exrSpaces = computed(() => colorConfig.value?.spaces.filter((name) => name !== colorConfig.value?.working) ?? []);
/** The one that is meant, null where it is Rec. 709 or this server has none of that name. */
export const availableExrSpace = computed(() => (exrSpaces.value.includes(exrSpace.value) ? exrSpace.value : null));

/** A tone map as text: its name, or a view as JSON. */
export const toneMapKey = (value: ToneMap): string => (typeof value === "string" ? value : JSON.stringify([value.display, value.view]));

export function parseToneMapKey(key: string): ToneMap {
  if (!key.startsWith("[")) return key as ToneMap;
  const [display, view] = JSON.parse(key) as [string, string];
  return { display, view };
}

/** Whether the server has a view. */
export const hasOcioView = ({ display, view }: OcioView): boolean =>
  colorConfig.value?.displays.some((each) => each.name === display && each.views.includes(view)) ?? false;

/** How a tone map is displayed; null while it is loading. Views that are missing or invalid fall back to AgX. */
export function lutFor(value: ToneMap): DisplayedToneMap | null {
  if (typeof value === "string") return value;
  if (colorConfig.value === null) return null;
  const table = hasOcioView(value) ? lutTables.value.get(toneMapKey(value)) : null;
  return table === undefined ? null : (table ?? "agx");
}

/** The same for what cannot wait. */
export const displayedToneMap = (value: ToneMap): DisplayedToneMap => lutFor(value) ?? "agx";
