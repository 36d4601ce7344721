/** How several pictures share the space. */
import { fitWidth, MARGIN_BESIDE } from "../picture/transform";

/** The number of columns in which `count` pictures of an aspect become largest; of equals, the wider arrangement. */
export function columnsFor(count: number, width: number, height: number, aspect: number): number {
  const shown = (columns: number) =>
    fitWidth({ width: width / columns, height: height / Math.ceil(count / columns), aspect, margin: MARGIN_BESIDE });
  let best = count;
  for (let columns = count - 1; columns > 0; columns--) if (shown(columns) > shown(best)) best = columns;
  return best;
}
