/** Labels of the light paths. */
import { RANGES } from "../../look.gen";
import type { Transport } from "../../protocol";
import type { RadioOption } from "../../ui/RadioRow";

interface PathLabels extends RadioOption<Transport["show"]> {
  /** Of an image that shows nothing else; null where it shows all. */
  only: string | null;
}

const MAX_BOUNCES = RANGES.transport.bounces.maximum;

export const LIGHT_PATHS: readonly PathLabels[] = [
  { value: "all", label: "All", title: "All light", only: null },
  { value: "direct", label: "Direct", title: "Light straight from its sources", only: "direct light" },
  {
    value: "indirect",
    label: "Reflected",
    title: "Light that surfaces have passed on",
    only: "reflected light",
  },
  {
    value: "first_bounce",
    label: "First",
    title: "Light that one surface has passed on",
    only: "the first bounce",
  },
  {
    value: "further_bounces",
    label: "Rest",
    title: "Light that two surfaces or more have passed on",
    only: "light after the first bounce",
  },
];

/** Label of the active light-path filter; null without one. */
export function pathFilterText({ show, bounces }: Transport): string | null {
  const only = LIGHT_PATHS.find((path) => path.value === show)?.only ?? null;
  if (only !== null) return `Only ${only}`;
  if (bounces >= MAX_BOUNCES) return null;
  return bounces === 0 ? "Only direct light" : `At most ${bounces} ${bounces === 1 ? "bounce" : "bounces"}`;
}
