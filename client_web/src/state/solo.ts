/** Solo: one material as it is, the others in dim grey; one light alone, the others dark. What is seen, no edit. */
import type { Light, Look } from "../protocol";
import { seenPaths, selectedLight, selectedMaterial, solo, soloLight } from "./store";

/** What is alone after the switch was pressed with `selected` selected. */
export function nextSolo(current: string | null, selected: string | null): string | null {
  return selected === null || selected === current ? null : selected;
}

export function toggleMaterialSolo(): void {
  solo.value = nextSolo(solo.value, selectedMaterial.value);
}

/** What is selected, alone. */
export function toggleSolo(): void {
  if (selectedLight.value === null) toggleMaterialSolo();
  else toggleLightSolo(selectedLight.value);
}

export function toggleLightSolo(source: string): void {
  soloLight.value = nextSolo(soloLight.value, source);
}

/** The environment among the lights: no light has this name. */
export const ENVIRONMENT = "";

/** Whether a look has this source of light; one that was removed can come back by undo. */
export function hasSource(look: Look, source: string): boolean {
  return source === ENVIRONMENT || look.lights[source] !== undefined;
}

const whole = new WeakMap<Look, Look>();

function withOneLight(look: Look, source: string): Look {
  const off = ([name, light]: [string, Light]) => [name, name === source ? { ...light, on: true } : { ...light, on: false }];
  const lights = Object.fromEntries(Object.entries(look.lights).map(off)) as Look["lights"];
  const environment = source === ENVIRONMENT ? look.environment : { ...look.environment, scale: 0 };
  return { ...look, environment, lights };
}

/** What the server shall show of a look: while one source of light is alone, that one; while some light paths are
 * looked at, those; otherwise the look itself. */
export function seenOf(look: Look): Look {
  const [source, paths] = [soloLight.peek(), seenPaths.peek()];
  const isAlone = source !== null && hasSource(look, source);
  if (!isAlone && paths === null) return look;
  const lit = isAlone ? withOneLight(look, source) : look;
  const seen = paths === null ? lit : { ...lit, transport: paths };
  whole.set(seen, look);
  return seen;
}

/** The look that something seen was made of; any other is itself. */
export function wholeOf(look: Look): Look {
  return whole.get(look) ?? look;
}
