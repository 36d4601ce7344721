/** What the picture leaves out, in words, each with a way back to the whole. */
import { computed } from "@preact/signals";
import { defaultLook, look } from "../state/look";
import { limitWords } from "./pathWords";
import { seenPaths, seePaths, shownPaths } from "./paths";
import { hasSource, solo, soloLight } from "./solo";

export interface Limit {
  words: string;
  /** What lifting it does. */
  title: string;
  lift(): void;
}

function showAllPaths(): void {
  const initial = defaultLook.peek()?.transport;
  if (initial !== undefined) seePaths(initial);
}

/** Whether light of the look is left out now: one light alone is no picture of a look, nor are some of its paths. */
export function isPartOfLook(): boolean {
  return soloLight.peek() !== null || seenPaths.peek() !== null;
}

/** Of light: what is missing in the pictures of the server, so in exported ones too. */
export const lightLimits = computed<Limit[]>(() => {
  const found: Limit[] = [];
  if (look.value === null || shownPaths.value === null) return found;
  const paths = limitWords(shownPaths.value);
  if (paths !== null) found.push({ words: paths, title: "Show all light again", lift: showAllPaths });
  const source = soloLight.value;
  if (source !== null && hasSource(look.value, source)) {
    const words = `Only the light of ${source || "the environment"}`;
    found.push({ words, title: "Show all lights again", lift: () => (soloLight.value = null) });
  }
  return found;
});

/** Of light, and of materials, which only the screen greys out. */
export const limits = computed<Limit[]>(() => {
  if (solo.value === null) return lightLimits.value;
  const alone = { words: `Only ${solo.value}`, title: "Show all materials again (S)", lift: () => (solo.value = null) };
  return [...lightLimits.value, alone];
});

/** ": only direct light" where the pictures of the server leave something out. */
export function lightLimitWords(): string {
  const words = lightLimits.value.map((limit) => limit.words).join(", ");
  return words === "" ? "" : `: ${words.charAt(0).toLowerCase()}${words.slice(1)}`;
}
