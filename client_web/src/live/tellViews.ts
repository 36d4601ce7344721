/** Which views a server is asked to show, and from where. */
import type { HelloMessage } from "../protocol";
import { placedEye } from "../state/eyes";
import { availableOf, shownViews, viewName } from "../state/views";
import { connections, type BakeConnection } from "./connections";
import { nothingIsExact } from "./exactness";

/** Of a bake's views, those that the user wants to see. */
export function shownOf({ views, view }: HelloMessage): string[] {
  const names = views.map(({ name }) => name);
  return availableOf(shownViews.peek(), names, names.includes(view) ? view : (names[0] ?? view));
}

/** The view that the hand will be in when a bake is shown. */
export function activeOf(hello: HelloMessage): string | null {
  const [shown, active] = [shownOf(hello), viewName.peek()];
  return shown.includes(active) ? active : (shown[0] ?? null);
}

/** Say which views are shown, where that is news, and which of them goes first. */
export function tellViews(of: BakeConnection, shown: string[], focus: string): void {
  const names = JSON.stringify(shown);
  if (of.toldViews !== names) {
    if (!of.session.send({ type: "views", names: shown })) return;
    of.toldViews = names;
    of.arrivals.keep(shown);
    if (of === connections.shown) nothingIsExact(shown); // they are sent whole again
  }
  if (shown.length > 1 && shown.includes(focus)) of.session.send({ type: "focus", view: focus });
}

/** Say where hands have put the eyes of views that move: a bake that is on its way is seen from there at once. */
export function tellEyes(of: BakeConnection, hello: HelloMessage): void {
  const shown = shownOf(hello);
  for (const { name, eye } of hello.views) {
    const placed = eye === "free" && shown.includes(name) ? placedEye(name) : null;
    if (placed === null) continue;
    const { camera, size } = placed;
    of.session.send({ type: "eye", view: name, eye: Date.now(), ...camera, size, hand: null, rest: "exact" });
  }
}
