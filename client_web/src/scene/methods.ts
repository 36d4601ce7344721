/** What a bake may follow of light, in words. */
export type Method = "direct" | "gather" | "surface";

/** What is baked where nobody chooses: without indirect light metal and glass mirror no objects. */
export const DEFAULT_METHOD: Method = "gather";

interface MethodWords {
  name: Method;
  label: string;
  /** Beside a size, where room is small. */
  short: string;
  help: string;
}

export const METHODS: readonly MethodWords[] = [
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
    name: "surface",
    label: "Moving view",
    short: "moving",
    help: "Look from anywhere while you edit, with reflected light. Fine shadows and sharp highlights are approximate.",
  },
];

/** The words of a bake's method; those of direct light for one that this editor does not know. */
export function wordsOf(method: string | null): MethodWords {
  return METHODS.find(({ name }) => name === method) ?? (METHODS[0] as MethodWords);
}
