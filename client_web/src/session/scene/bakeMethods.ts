/** Labels of the bake methods. */
export type BakeMethod = "direct" | "gather" | "probes";

/** What is baked where nobody chooses: without indirect light metal and glass mirror no objects. */
export const DEFAULT_BAKE_METHOD: BakeMethod = "gather";

interface MethodLabels {
  name: BakeMethod;
  label: string;
  /** Beside a size, where room is small. */
  short: string;
  help: string;
}

export const BAKE_METHODS: readonly MethodLabels[] = [
  {
    name: "direct",
    label: "Direct light",
    short: "direct",
    help: "Light from its sources with its shadows. Quick to bake, and to edit.",
  },
  {
    name: "gather",
    label: "With reflected light",
    short: "reflected",
    help: "Surfaces light each other too, and take on each other’s colours. Takes longer and more memory.",
  },
  {
    name: "probes",
    label: "Moving view",
    short: "moving",
    help: "Look from anywhere while you edit, with reflected light. Fine shadows and sharp highlights are approximate.",
  },
];

/** The labels of a bake's method; those of direct light for an unknown method. */
export function methodLabelsOf(method: string | null): MethodLabels {
  return BAKE_METHODS.find(({ name }) => name === method) ?? (BAKE_METHODS[0] as MethodLabels);
}
