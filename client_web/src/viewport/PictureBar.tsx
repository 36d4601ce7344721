/** Under the picture: the probed pixel on the left, zoom on the right. */
import { toDisplay } from "../color/tonemap";
import { stage } from "../picture/stage";
import { zoomActual, zoomBy, zoomFactor, zoomFit } from "../picture/zoom";
import { toneMap } from "../state/color";
import { openComments } from "../state/comments";
import { drawn, falseColour } from "../state/display";
import { exposure } from "../state/look";
import { histogramOpen } from "../state/panels";
import { probe } from "../state/probe";
import { shownPanels, togglePanel } from "../state/room";
import { formatNumber } from "../ui/scale";

function Probe() {
  drawn.value;
  const at = probe.value;
  const picture = at === null ? null : stage.of(at.view);
  const radiance = at === null ? null : (picture?.radiance(at.x, at.y) ?? null);
  if (at === null || radiance === null) return <span class="probe quiet">Point at the picture to read a pixel</span>;
  const shown = toDisplay(radiance, exposure.value, toneMap.value).map((v) => Math.round(255 * v));
  const material = picture?.ids ? picture.material(at.x, at.y) : at.answer?.material;
  return (
    <span class="probe">
      <i class="chip" style={{ background: `rgb(${shown.join(" ")})` }} />
      <span class="where">
        {at.x}, {at.y}
      </span>
      <span class="linear" title="Linear radiance">
        {radiance.map((v, c) => (
          <b key={c} class={["red", "green", "blue"][c]}>
            {formatNumber(v)}
          </b>
        ))}
      </span>
      <span class="display" title="After exposure and tone mapping, 0 to 255">
        {shown.map((v) => String(v).padStart(3, "\u2007")).join(" ")}
      </span>
      <span class="material">{material ?? "background"}</span>
    </span>
  );
}

export function PictureBar() {
  drawn.value;
  return (
    <div class="picture-bar">
      <Probe />
      <span class="spacer" />
      <button
        aria-pressed={shownPanels.value.includes("comments")}
        title="Words that people pinned to pixels (N: a new one)"
        onClick={() => togglePanel("comments")}
      >
        Comments{openComments.value.length > 0 && <span class="count">{openComments.value.length}</span>}
      </button>
      <button
        aria-pressed={histogramOpen.value}
        title="How often each brightness occurs (H)"
        onClick={() => (histogramOpen.value = !histogramOpen.value)}
      >
        Histogram
      </button>
      <button
        aria-pressed={falseColour.value}
        title="Luminance in stops, as colours (E)"
        onClick={() => (falseColour.value = !falseColour.value)}
      >
        False colour
      </button>
      <button class="icon" aria-label="Zoom out" title="Zoom out (−)" onClick={() => zoomBy(1 / 1.25)}>
        −
      </button>
      <span class="zoom" aria-live="off">
        {stage.active.isThere ? `${Math.round(100 * zoomFactor())} %` : "–"}
      </span>
      <button class="icon" aria-label="Zoom in" title="Zoom in (+)" onClick={() => zoomBy(1.25)}>
        +
      </button>
      <button title="Fit the picture (F)" onClick={zoomFit}>
        Fit
      </button>
      <button title="One to one (1)" onClick={zoomActual}>
        1:1
      </button>
    </div>
  );
}
