/** Frames to pictures: the first of a view is kept aside until it is whole; a finer bake takes over when the view that
 * the hand is in is. */
import { batch } from "@preact/signals";
import { request } from "../net/api";
import type { Frame } from "../net/binaryFrame";
import type { Arrival } from "../picture/arrival";
import { decodeIds } from "../picture/png16";
import { stage } from "../picture/stage";
import { axes, bake, coming, method } from "../state/bakes";
import { connection, freezing } from "../state/connection";
import { bakedError, movingError } from "../state/fidelity";
import { forgetWaiting } from "../state/latency";
import { shownViews, viewName, views } from "../state/views";
import { attempt, note, showError } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { noteShown, nothingIsExact } from "./exactness";
import { activeOf, shownOf } from "./tellViews";
import { takeOver } from "./together";

async function loadIds(of: string, view: string, arrival: Arrival): Promise<void> {
  await attempt(async () => {
    const path = `/api/bakes/${encodeURIComponent(of)}/views/${encodeURIComponent(view)}/materials.png`;
    arrival.ids = decodeIds(await (await request(path)).arrayBuffer());
    const picture = stage.of(view);
    if (picture.idsOf === of) picture.setIds(arrival.ids);
  });
}

export async function takeFrame(from: BakeConnection, frame: Frame): Promise<void> {
  const { view, kind } = frame.header;
  const isShown = from === connections.shown;
  if (from !== connections.incoming && !(isShown && shownViews.peek().includes(view))) return;
  if (!from.arrivals.isShown(view)) return kind === "brush" ? undefined : arrive(from, frame);
  await stage.of(view).show(frame).catch(showError);
  if (kind === "picture" && from === connections.shown) noteShown(from, frame.header);
}

/** Take a frame of a view whose first picture is on its way: what is shown stays until that is whole. */
async function arrive(from: BakeConnection, frame: Frame): Promise<void> {
  const { view } = frame.header;
  const isNew = from.arrivals.get(view) === undefined;
  const arrival = from.arrivals.take(frame);
  const isFixed = from.hello?.views.find(({ name }) => name === view)?.eye !== "free"; // else its pixels are of no place
  if (isNew && isFixed && stage.of(view).idsOf !== from.bake) void loadIds(from.bake, view, arrival);
  if (!arrival.isWhole) return;
  if (from === connections.shown) return showArrived(from, view);
  await swapWhereWhole();
}

async function showArrived(of: BakeConnection, view: string): Promise<void> {
  const [arrival, picture] = [of.arrivals.get(view), stage.of(view)];
  if (arrival === undefined) return;
  of.arrivals.show(view);
  if (picture.idsOf !== of.bake) {
    picture.idsOf = of.bake;
    picture.setIds(arrival.ids);
  }
  if (coming.peek()?.id === of.bake) coming.value = null;
  await picture.showArrived(arrival).catch(showError);
  if (of === connections.shown) noteShown(of, arrival.header);
}

/** Follow a connection from now on: its bake and views. */
export function showBake(of: BakeConnection): void {
  if (of.hello === null) return;
  const { views: baked, method: light, axes: changeable, moving_error: error } = of.hello;
  const shown = shownOf(of.hello);
  batch(() => {
    views.value = baked;
    shownViews.value = shown;
    if (bake.peek() !== of.bake) movingError.value = null; // of another
    bakedError.value = error;
    if (!shown.includes(viewName.peek())) viewName.value = shown[0] as string;
    bake.value = of.bake;
    method.value = light;
    axes.value = changeable;
  });
}

/** The new bake takes over once the view that the hand is in is whole; those beside it follow as they come. */
export async function swapWhereWhole(): Promise<void> {
  const { incoming } = connections;
  const active = incoming?.hello ? activeOf(incoming.hello) : null;
  if (incoming === null || active === null) return;
  if (incoming.arrivals.get(active)?.isWhole) await swap(incoming);
}

async function swap(to: BakeConnection): Promise<void> {
  const old = connections.shown;
  connections.shown = to;
  connections.incoming = null;
  takeOver(old, to);
  old?.session.close();
  freezing.value = null;
  forgetWaiting();
  showBake(to);
  connection.value = "open";
  const shown = shownViews.peek();
  nothingIsExact(shown);
  const whole = shown.filter((view) => to.arrivals.get(view)?.isWhole);
  await Promise.all(whole.map((view) => showArrived(to, view)));
  if (to.bake !== old?.bake) note("The new bake is in place.");
}
