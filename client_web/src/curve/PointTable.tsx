/** The points as numbers. */
import { MAX_CURVE_VALUE } from "../look.gen";
import type { Point } from "../protocol";
import { IconButton } from "../ui/Button";
import { NumberField } from "../ui/NumberField";
import { deletePoint, moveTo, resetPoint } from "./Handles";
import { outlineOf } from "./model/fit";
import { putPoints } from "./model/model";
import { addPoint } from "./model/points";
import { bandOf, picked, type Hand } from "./tools";

/** Half-way along the widest gap, degrees. */
function widestGap(points: Point[]): number {
  let [best, at] = [-1, 45];
  points.forEach(([x], i) => {
    const next = points[i + 1]?.[0] ?? x;
    if (next - x > best) [best, at] = [next - x, (x + next) / 2];
  });
  return at;
}

export function PointTable({ hand, points }: { hand: Hand; points: Point[] }) {
  const add = () => {
    const bands = hand.model.curves[hand.channels[0] ?? 0] ?? [];
    const [[degrees, value]] = outlineOf([[widestGap(points), 0]], bands) as [Point];
    const added = addPoint(points, degrees, value, bandOf(hand));
    putPoints(hand.model, "Add point", points, added.points, hand.channels);
    if (added.index >= 0) picked.value = { index: added.index, carried: false };
  };
  return (
    <div class="point-table">
      <table>
        <thead>
          <tr>
            <th scope="col">Angle °</th>
            <th scope="col">Value</th>
            <th scope="col">
              <IconButton
                icon="plus"
                label="Add a point in the widest gap"
                onClick={add}
              />
            </th>
          </tr>
        </thead>
        <tbody>
          {points.map(([degrees, value], index) => (
            <tr key={index} class={picked.value?.index === index ? "picked" : ""}>
              <td>
                <NumberField
                  label={`Point ${index + 1}, angle`}
                  value={degrees}
                  minimum={0}
                  maximum={90}
                  step={0.5}
                  onChange={(x) => moveTo(hand, points, index, x, value)}
                />
              </td>
              <td>
                <NumberField
                  label={`Point ${index + 1}, value`}
                  value={value}
                  minimum={0}
                  maximum={MAX_CURVE_VALUE}
                  step={value > 0 ? value / 50 : hand.axes.top / 1000}
                  onChange={(y) => moveTo(hand, points, index, degrees, y)}
                />
              </td>
              <td class="row-actions">
                <IconButton
                  icon="reset"
                  label={`Point ${index + 1}: back to the model's curve`}
                  onClick={() => resetPoint(hand, points, index)}
                />
                <IconButton
                  icon="close"
                  label={`Delete point ${index + 1}`}
                  disabled={points.length <= 2}
                  onClick={() => deletePoint(hand, points, index)}
                />
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
