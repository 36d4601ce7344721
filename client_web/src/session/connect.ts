/** Opening a session with a bake. */
import { effect, untracked } from "@preact/signals";
import { focusedView, shownViews, activeViewName } from "../state/views";
import { BakeConnection, connections } from "./connections";
import { makeSessionHandlers } from "./sessionHandlers";
import { swapWhenComplete } from "./bakeSwap";
import { shownViewsOf, sendViews } from "./sendViews";

/** Open a session; an existing one continues until the new one has an image. */
export function connectToBake(bake: string): void {
  connections.incoming?.session.close();
  connections.incoming = null;
  const newConnection = new BakeConnection(bake, makeSessionHandlers);
  connections[connections.shown === null ? "shown" : "incoming"] = newConnection;
  newConnection.session.connect();
}

effect(() => {
  const [names, focus] = [shownViews.value, focusedView.value];
  const { shown, incoming } = connections;
  if (shown !== null && names.length > 0) sendViews(shown, names, focus);
  if (incoming?.hello) sendViews(incoming, shownViewsOf(incoming.hello), focus);
});

// the active view may become one that was already complete
effect(() => {
  void activeViewName.value;
  void shownViews.value;
  untracked(() => void swapWhenComplete());
});
