/** The curve's points as an editable table. */
import { MAX_CURVE_VALUE } from "../look.gen";
import type { Point } from "../protocol";
import { IconButton } from "../ui/IconButton";
import { NumberField } from "../ui/NumberField";
import { deletePoint, movePointTo, resetPoint } from "./PointHandles";
import { outlinePoints } from "./model/fit";
import { applyPoints } from "./model/model";
import { addPoint } from "./model/points";
import { bandOf, pickedPoint, type CurveContext } from "./curveTools";

/** The middle of the widest gap, degrees. */
function findWidestGap(points: Point[]): number {
  let [best, midpoint] = [-1, 45];
  points.forEach(([x], i) => {
    const next = points[i + 1]?.[0] ?? x;
    if (next - x > best) [best, midpoint] = [next - x, (x + next) / 2];
  });
  return midpoint;
}

export function PointTable({ context, points }: { context: CurveContext; points: Point[] }) {
  const add = () => {
    const bands = context.model.curves[context.channels[0] ?? 0] ?? [];
    const [[degrees, value]] = outlinePoints([[findWidestGap(points), 0]], bands) as [Point];
    const added = addPoint(points, degrees, value, bandOf(context));
    applyPoints(context.model, "Add point", points, added.points, context.channels);
    if (added.index >= 0) pickedPoint.value = { index: added.index, carried: false };
  };
  return (
    <div class="point-table">
      <table>
        <thead>
          <tr>
            <th scope="col">Angle °</th>
            <th scope="col">Value</th>
            <th scope="col">
              <IconButton icon="plus" label="Add point in the widest gap" onClick={add} />
            </th>
          </tr>
        </thead>
        <tbody>
          {points.map(([degrees, value], index) => (
            <tr key={index} class={pickedPoint.value?.index === index ? "picked" : ""}>
              <td>
                <NumberField
                  label={`Point ${index + 1}, angle`}
                  value={degrees}
                  minimum={0}
                  maximum={90}
                  step={0.5}
                  onChange={(x) => movePointTo(context, points, index, x, value)}
                />
              </td>
              <td>
                <NumberField
                  label={`Point ${index + 1}, value`}
                  value={value}
                  minimum={0}
                  maximum={MAX_CURVE_VALUE}
                  step={value > 0 ? value / 50 : context.axes.top / 1000}
                  onChange={(y) => movePointTo(context, points, index, degrees, y)}
                />
              </td>
              <td class="row-actions">
                <IconButton
                  icon="reset"
                  label={`Reset point ${index + 1}`}
                  onClick={() => resetPoint(context, points, index)}
                />
                <IconButton
                  icon="close"
                  label={`Delete point ${index + 1}`}
                  disabled={points.length <= 2}
                  onClick={() => deletePoint(context, points, index)}
                />
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
