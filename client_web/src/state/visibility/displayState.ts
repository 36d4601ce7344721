/** The visible state as a look, for images rendered outside the session. */
import type { Light, Look } from "../../protocol";
import { withVisiblePaths } from "./lightPaths";
import { ENVIRONMENT_SOURCE, hasLightSource, soloLight } from "./soloSources";

function withSingleLight(look: Look, source: string): Look {
  const off = ([name, light]: [string, Light]) => [name, { ...light, enabled: name === source }];
  const lights = Object.fromEntries(Object.entries(look.lights).map(off)) as Look["lights"];
  const environment = source === ENVIRONMENT_SOURCE ? look.environment : { ...look.environment, intensity: 0 };
  return { ...look, environment, lights };
}

/** A look with the light-path filter and the solo light applied. */
export function visibleLookOf(look: Look): Look {
  const source = soloLight.peek();
  const soloLook = source !== null && hasLightSource(look, source) ? withSingleLight(look, source) : look;
  return withVisiblePaths(soloLook);
}
