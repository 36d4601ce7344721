/** The points as numbers. */
import type { Point } from "../protocol";
import { IconButton } from "../ui/Button";
import { NumberField } from "../ui/NumberField";
import { put } from "./model";
import { addPoint, movePoint } from "./points";
import { deletePoint, resetPoint } from "./Handles";
import { pchip } from "./pchip";
import { picked, type Hand } from "./tools";

/** Half-way along the widest gap, on the curve. */
function widestGap(points: Point[]): Point {
  let [best, at] = [-1, 45];
  points.forEach(([x], i) => {
    const next = points[i + 1]?.[0] ?? x;
    if (next - x > best) [best, at] = [next - x, (x + next) / 2];
  });
  return [at, pchip(points)(at)];
}

export function PointTable({ hand, points }: { hand: Hand; points: Point[] }) {
  const move = (index: number, degrees: number, value: number) =>
    put(hand.model, "Move point", () => movePoint(points, index, degrees, value), hand.channels);
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
                onClick={() => {
                  const added = addPoint(points, ...widestGap(points));
                  put(hand.model, "Add point", () => added.points, hand.channels);
                  if (added.index >= 0) picked.value = { index: added.index, carried: false };
                }}
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
                  onChange={(x) => move(index, x, value)}
                />
              </td>
              <td>
                <NumberField
                  label={`Point ${index + 1}, value`}
                  value={value}
                  minimum={0}
                  maximum={1e6}
                  step={Math.max(0.01, value / 50)}
                  onChange={(y) => move(index, degrees, y)}
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
