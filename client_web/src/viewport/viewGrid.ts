/** Grid layout of several views. */
import { fitWidth, MARGIN_GRID } from "../render/zoomTransform";

/** Number of columns that maximizes the size of `count` images of an aspect ratio; ties prefer more columns. */
export function columnsFor(count: number, width: number, height: number, aspect: number): number {
  const displayedSize = (columns: number) =>
    fitWidth({ width: width / columns, height: height / Math.ceil(count / columns), aspect, margin: MARGIN_GRID });
  let best = count;
  for (let columns = count - 1; columns > 0; columns--)
    if (displayedSize(columns) > displayedSize(best)) best = columns;
  return best;
}
