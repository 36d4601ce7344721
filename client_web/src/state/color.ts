/** The server's OpenColorIO config, and display transforms: tone maps, or tables of its views. */
import { computed, signal } from "@preact/signals";
import type { LutTable } from "../render/color/lutTable";
import type { DisplayedToneMap, DisplayTransform } from "../render/color/tonemap";
import { displayMatrix } from "../render/color/whiteBalance";
import type { ColorBody, Look, OcioView } from "../protocol";
import { contrast, displayGain } from "./look";

type ToneMap = Look["display"]["tone_map"];

export const colorConfig = signal<ColorBody | null>(null);
/** Tables by view key, or name of a display LUT; null: failed. */
export const lutTables = signal<ReadonlyMap<string, LutTable | null>>(new Map());
/** The current tone map and display LUT. */
export const toneMap = signal<DisplayedToneMap>("agx");
export const displayLut = signal<LutTable | null>(null);
/** The current display transform. */
export const displayTransform = computed<DisplayTransform>(() => ({
  matrix: displayGain.value,
  contrast: contrast.value,
  toneMap: toneMap.value,
  lut: displayLut.value,
}));

/** The chosen color space of EXR files; "": linear Rec. 709. */
export const exrSpace = signal("");
/** Color spaces of the server's config, without its linear Rec. 709. */
export const exrSpaces = computed(
  () => colorConfig.value?.spaces.filter((name) => name !== colorConfig.value?.working) ?? [],
);
/** The chosen color space; null for Rec. 709 or if this server does not have it. */
export const availableExrSpace = computed(() => (exrSpaces.value.includes(exrSpace.value) ? exrSpace.value : null));

/** A tone map's key: its name, or a view as JSON. */
export const toneMapKey = (value: ToneMap): string =>
  typeof value === "string" ? value : JSON.stringify([value.display, value.view]);

export function parseToneMapKey(key: string): ToneMap {
  if (!key.startsWith("[")) return key as ToneMap;
  const [display, view] = JSON.parse(key) as [string, string];
  return { display, view };
}

/** True if the server has a view. */
export const hasOcioView = ({ display, view }: OcioView): boolean =>
  colorConfig.value?.displays.some((each) => each.name === display && each.views.includes(view)) ?? false;

/** The display transform of a tone map; null while loading. Missing or invalid views fall back to AgX. */
export function lutFor(value: ToneMap): DisplayedToneMap | null {
  if (typeof value === "string") return value;
  if (colorConfig.value === null) return null;
  const table = hasOcioView(value) ? lutTables.value.get(toneMapKey(value)) : null;
  return table === undefined ? null : (table ?? "agx");
}

/** The table of a display LUT; undefined while loading, null without one. */
export const displayLutFor = (name: string | null | undefined): LutTable | null | undefined =>
  name ? lutTables.value.get(name) : null;

/** The display transform of a look without waiting: falls back to AgX, and to no LUT, while loading. */
export const transformOf = ({
  exposure,
  temperature,
  tint,
  contrast,
  tone_map,
  lut,
}: Look["display"]): DisplayTransform => ({
  matrix: displayMatrix(exposure, temperature, tint),
  contrast,
  toneMap: lutFor(tone_map) ?? "agx",
  lut: displayLutFor(lut) ?? null,
});
