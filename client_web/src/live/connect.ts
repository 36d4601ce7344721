/** Opening a session with a bake. */
import { effect, untracked } from "@preact/signals";
import { focusedView, shownViews, viewName } from "../state/views";
import { BakeConnection, connections } from "./connections";
import { handlersOf } from "./handlers";
import { swapWhereWhole } from "./swap";
import { shownOf, tellViews } from "./tellViews";

/** Open a session; where there is one already, it goes on until the new one has a picture. */
export function connect(bake: string): void {
  connections.incoming?.session.close();
  connections.incoming = null;
  const opened = new BakeConnection(bake, handlersOf);
  connections[connections.shown === null ? "shown" : "incoming"] = opened;
  opened.session.connect();
}

effect(() => {
  const [names, focus] = [shownViews.value, focusedView.value];
  const { shown, incoming } = connections;
  if (shown !== null && names.length > 0) tellViews(shown, names, focus);
  if (incoming?.hello) tellViews(incoming, shownOf(incoming.hello), focus);
});

// the hand may come to a view that was whole before
effect(() => {
  viewName.value;
  shownViews.value;
  untracked(() => void swapWhereWhole());
});
