/** How several images share the space. */
import { fitWidth, MARGIN_GRID } from "../render/zoomTransform";

/** The number of columns in which `count` images of an aspect become largest; of equals, the wider arrangement. */
export function columnsFor(count: number, width: number, height: number, aspect: number): number {
  const displayedSize = (columns: number) =>
    fitWidth({ width: width / columns, height: height / Math.ceil(count / columns), aspect, margin: MARGIN_GRID });
  let best = count;
  for (let columns = count - 1; columns > 0; columns--) if (displayedSize(columns) > displayedSize(best)) best = columns;
  return best;
}
