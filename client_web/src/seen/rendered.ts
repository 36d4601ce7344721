/** What is seen, as a look: for pictures that are rendered apart from the session, which know no other way to say it. */
import type { Light, Look } from "../protocol";
import { withSeenPaths } from "./paths";
import { ENVIRONMENT, hasSource, soloLight } from "./solo";

function withOneLight(look: Look, source: string): Look {
  const off = ([name, light]: [string, Light]) => [name, { ...light, on: name === source }];
  const lights = Object.fromEntries(Object.entries(look.lights).map(off)) as Look["lights"];
  const environment = source === ENVIRONMENT ? look.environment : { ...look.environment, scale: 0 };
  return { ...look, environment, lights };
}

/** A look with the light paths that are looked at, and while one source of light is alone, with that one. */
export function seenOf(look: Look): Look {
  const source = soloLight.peek();
  const lit = source !== null && hasSource(look, source) ? withOneLight(look, source) : look;
  return withSeenPaths(lit);
}
