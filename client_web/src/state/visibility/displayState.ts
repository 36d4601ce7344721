/** The visible state as a look, for images rendered outside the session. */
import type { Light, Look } from "../../protocol";
import { withVisiblePaths } from "./lightPaths";
import { ENVIRONMENT_SOURCE, lightsOfSource, soloLight } from "./soloSources";

function withSingleSource(look: Look, source: string, names: readonly string[]): Look {
  const off = ([name, light]: [string, Light]) => [name, { ...light, enabled: names.includes(name) }];
  const unmuted = Object.entries(look.light_groups).map(([name, group]) => [name, { ...group, enabled: true }]);
  const lights = Object.fromEntries(Object.entries(look.lights).map(off)) as Look["lights"];
  const environment = source === ENVIRONMENT_SOURCE ? look.environment : { ...look.environment, intensity: 0 };
  return { ...look, environment, lights, light_groups: Object.fromEntries(unmuted) as Look["light_groups"] };
}

/** A look with the light-path filter and the solo light applied. */
export function visibleLookOf(look: Look): Look {
  const source = soloLight.peek();
  const names = source === null ? null : lightsOfSource(look, source);
  const soloLook = source !== null && names !== null ? withSingleSource(look, source, names) : look;
  return withVisiblePaths(soloLook);
}
