/** Bar under the image: pixel probe on the left, view controls on the right. */
import { toggleMatch } from "../panels/lights/match/match";
import { isMatchOpen } from "../state/match";
import { toDisplay } from "../render/color/tonemap";
import { stage } from "../render/renderStage";
import { zoomActual, zoomBy, zoomFactor, zoomFit } from "../render/zoom";
import { displayTransform } from "../state/color";
import { isAreaProbeOn } from "../state/areaProbe";
import { openComments } from "../state/comments";
import { displayedFrames, falseColor } from "../state/display";
import { histogramOpen } from "../state/panels";
import { pixelProbe } from "../state/pointerPixel";
import { shownPanels, togglePanel } from "../state/panelWidths";
import { formatNumber } from "../ui/scale";
import { toggleAreaProbe } from "./AreaProbe";

function PixelProbe() {
  void displayedFrames.value;
  const probed = pixelProbe.value;
  const image = probed === null ? null : stage.imageOf(probed.view);
  const radiance = probed === null ? null : (image?.radiance(probed.x, probed.y) ?? null);
  if (probed === null || radiance === null) return <span class="probe quiet">Hover to inspect a pixel</span>;
  const displayed = toDisplay(radiance, displayTransform.value).map((v) => Math.round(255 * v));
  const material = image?.ids ? image.material(probed.x, probed.y) : probed.answer?.material;
  return (
    <span class="probe">
      <i class="chip" style={{ background: `rgb(${displayed.join(" ")})` }} />
      <span class="where">
        {probed.x}, {probed.y}
      </span>
      <span class="linear" title="Linear radiance">
        {radiance.map((v, c) => (
          <b key={c} class={["red", "green", "blue"][c]}>
            {formatNumber(v)}
          </b>
        ))}
      </span>
      <span class="display" title="After exposure and tone mapping, 0 to 255">
        {displayed.map((v) => String(v).padStart(3, "\u2007")).join(" ")}
      </span>
      <span class="material">{material ?? "background"}</span>
    </span>
  );
}

export function ViewportBar() {
  void displayedFrames.value;
  return (
    <div class="picture-bar">
      <PixelProbe />
      <span class="spacer" />
      <button
        aria-pressed={shownPanels.value.includes("comments")}
        title="Comments (N: add)"
        onClick={() => togglePanel("comments")}
      >
        Comments{openComments.value.length > 0 && <span class="count">{openComments.value.length}</span>}
      </button>
      <button aria-pressed={isMatchOpen.value} title="Paint light, and the lights are found (U)" onClick={toggleMatch}>
        Match
      </button>
      <button
        aria-pressed={isAreaProbeOn.value}
        title="Mean, minimum and maximum of a rectangle; drag it in the picture (R)"
        onClick={toggleAreaProbe}
      >
        Area
      </button>
      <button
        aria-pressed={histogramOpen.value}
        title="Histogram, waveform or RGB parade (H)"
        onClick={() => (histogramOpen.value = !histogramOpen.value)}
      >
        Scopes
      </button>
      <button
        aria-pressed={falseColor.value}
        title="Exposure heat map: luminance in stops (E)"
        onClick={() => (falseColor.value = !falseColor.value)}
      >
        Heat map
      </button>
      <button class="icon" aria-label="Zoom out" title="Zoom out (−)" onClick={() => zoomBy(1 / 1.25)}>
        −
      </button>
      <span class="zoom" aria-live="off">
        {stage.active.hasPixels ? `${Math.round(100 * zoomFactor())} %` : "–"}
      </span>
      <button class="icon" aria-label="Zoom in" title="Zoom in (+)" onClick={() => zoomBy(1.25)}>
        +
      </button>
      <button title="Fit to window (F)" onClick={zoomFit}>
        Fit
      </button>
      <button title="Actual size (0)" onClick={zoomActual}>
        1:1
      </button>
    </div>
  );
}
