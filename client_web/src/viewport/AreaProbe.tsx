/** Area probe: a rectangle on the image, dragged or moved with keys, and the statistics of its pixels. */
import { makeGray } from "../panels/looks/whiteBalance";
import { areaStatistics, type AreaStatistics } from "../render/areaStatistics";
import type { ImageCanvas } from "../render/canvas";
import { stage } from "../render/renderStage";
import { transformOf } from "../render/viewTransforms";
import { toScreenPoint } from "../render/zoomTransform";
import { isAreaProbeOn, middleArea, probedArea, steppedArea, type Area } from "../state/areaProbe";
import { displayTransform } from "../state/color";
import { displayedFrames } from "../state/display";
import { mayEdit } from "../state/sessionUser";
import { formatNumber } from "../ui/scale";
import { useIdleFrame } from "./useIdleFrame";
import type { Rgb } from "../protocol";

const LARGE_STEP = 10;
const KEYS: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

export function toggleAreaProbe(): void {
  const { width, height } = stage.active.pixels;
  isAreaProbeOn.value = !isAreaProbeOn.value;
  probedArea.value ??= middleArea([width, height]);
}

/** The rectangle; arrow keys move it, with Shift they resize it, with Ctrl in large steps. */
export function AreaFrame({ screen }: { screen: ImageCanvas }) {
  void displayedFrames.value;
  const area = probedArea.value;
  if (!isAreaProbeOn.value || area === null) return null;
  const { image } = screen;
  const { width, height } = image.pixels;
  const [transform, geometry] = [transformOf(image.view), screen.size()];
  const [left, top] = toScreenPoint(transform, geometry, area.x / width, area.y / height);
  const [right, bottom] = toScreenPoint(
    transform,
    geometry,
    (area.x + area.width) / width,
    (area.y + area.height) / height,
  );
  const onKey = (event: KeyboardEvent) => {
    const step = KEYS[event.key];
    if (step === undefined) return;
    const factor = event.ctrlKey ? LARGE_STEP : 1;
    probedArea.value = steppedArea(area, step[0] * factor, step[1] * factor, event.shiftKey, [width, height]);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="area-frame"
      role="group"
      tabIndex={0}
      aria-label="Area probe. Arrow keys: move. Shift+arrows: resize. Ctrl: by 10 pixels."
      style={{ left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px` }}
      onKeyDown={onKey}
    />
  );
}

const stopText = (stops: number): string =>
  Number.isFinite(stops) ? `${stops < 0 ? "−" : "+"}${Math.abs(stops).toFixed(2)}` : "black";
const rgbText = (rgb: Rgb, format: (v: number) => string): string => rgb.map(format).join("  ");
const displayText = (v: number): string => String(Math.round(255 * v));

function StatisticsTable({ radiance, display, stops }: AreaStatistics) {
  const rows = (["mean", "minimum", "maximum"] as const).map((name) => ({
    name,
    cells: [rgbText(radiance[name], formatNumber), rgbText(display[name], displayText), stopText(stops[name])],
  }));
  return (
    <table>
      <thead>
        <tr>
          <th />
          <th scope="col">Linear</th>
          <th scope="col" title="As displayed, 0 to 255">
            Display
          </th>
          <th scope="col" title="Luminance relative to middle gray, after exposure and white balance">
            Stops
          </th>
        </tr>
      </thead>
      <tbody>
        {rows.map(({ name, cells }) => (
          <tr key={name}>
            <th scope="row">{{ mean: "Mean", minimum: "Min", maximum: "Max" }[name]}</th>
            {cells.map((cell, index) => (
              <td key={index}>{cell}</td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

const areaText = ({ x, y, width, height }: Area): string => `${width} × ${height} px at ${x}, ${y}`;

/** The statistics of the active view. */
export function AreaReadout() {
  void useIdleFrame();
  const area = probedArea.value;
  if (!isAreaProbeOn.value || area === null) return null;
  const { hasPixels, pixels } = stage.active;
  const statistics = hasPixels ? areaStatistics(pixels, area, displayTransform.value) : null;
  return (
    <section class="area-probe" aria-label="Area probe">
      <p role="status">{statistics === null ? "Outside the picture" : areaText(area)}</p>
      {statistics !== null && <StatisticsTable {...statistics} />}
      {statistics !== null && mayEdit.value && (
        <button
          title="Set the white balance so that the mean is gray"
          onClick={() => makeGray(statistics.radiance.mean)}
        >
          Make gray
        </button>
      )}
    </section>
  );
}
