/** Labels of the light paths. */
import { RANGES } from "../../look.gen";
import type { Transport } from "../../protocol";
import type { RadioOption } from "../../ui/RadioRow";

interface PathLabels extends RadioOption<Transport["show"]> {
  /** Description of the filtered image; null without a filter. */
  only: string | null;
}

const MAX_BOUNCES = RANGES.transport.bounces.maximum;

export const LIGHT_PATHS: readonly PathLabels[] = [
  { value: "all", label: "All", title: "All light", only: null },
  { value: "direct", label: "Direct", title: "Direct light from light sources", only: "Direct light only" },
  {
    value: "indirect",
    label: "Indirect",
    title: "Indirect light (1 or more bounces)",
    only: "Indirect light only",
  },
  {
    value: "first_bounce",
    label: "1 bounce",
    title: "Light after exactly one bounce",
    only: "1st bounce only",
  },
  {
    value: "further_bounces",
    label: "2+",
    title: "Light after two or more bounces",
    only: "2+ bounces only",
  },
];

/** Label of the active light-path filter; null without one. */
export function pathFilterText({ show, bounces }: Transport): string | null {
  const only = LIGHT_PATHS.find((path) => path.value === show)?.only ?? null;
  if (only !== null) return only;
  if (bounces >= MAX_BOUNCES) return null;
  return bounces === 0 ? "Direct light only" : `At most ${bounces} ${bounces === 1 ? "bounce" : "bounces"}`;
}
