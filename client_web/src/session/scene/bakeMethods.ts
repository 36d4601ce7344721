/** Labels of the bake methods. */
export type BakeMethod = "direct" | "gather" | "probes";

/** The default method: without indirect light, metal and glass do not reflect objects. */
export const DEFAULT_BAKE_METHOD: BakeMethod = "gather";

interface MethodLabels {
  name: BakeMethod;
  label: string;
  /** Short form, shown beside a size. */
  short: string;
  help: string;
}

export const BAKE_METHODS: readonly MethodLabels[] = [
  {
    name: "direct",
    label: "Direct light only",
    short: "direct light",
    help: "Lights and shadows, no bounces. Fast. Objects don’t appear in reflections.",
  },
  {
    name: "gather",
    label: "Global illumination",
    short: "GI",
    help: "Adds bounce light and color bleeding. Slower, needs more memory.",
  },
  {
    name: "probes",
    label: "Free camera (approximate)",
    short: "free camera",
    help: "Move the camera while you edit, with global illumination. Fine shadows and sharp highlights are approximate.",
  },
];

/** Labels of a bake method; those of direct light for an unknown one. */
export function methodLabelsOf(method: string | null): MethodLabels {
  return BAKE_METHODS.find(({ name }) => name === method) ?? (BAKE_METHODS[0] as MethodLabels);
}
