/** The image of one view, or of several side by side, with labels. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { CameraBar } from "./cameras/CameraBar";
import { MatchBar } from "../panels/lights/match/MatchBar";
import { PlacementBar } from "../panels/lights/PlacementBar";
import { shownViews, activeView } from "../state/views";
import { Toasts } from "../ui/toasts";
import { ViewCell } from "./ViewCell";
import { DifferenceLegend } from "./DifferenceLegend";
import { FalseColorLegend } from "./FalseColorLegend";
import { AreaReadout } from "./AreaProbe";
import { HistogramView } from "./HistogramView";
import { FilterBadge } from "./FilterBadge";
import { ViewportBar } from "./ViewportBar";
import { columnsFor } from "./viewGrid";

/** Size of an element, updated when it changes. */
function useElementSize() {
  const element = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<[width: number, height: number]>([1, 1]);
  useLayoutEffect(() => {
    const measured = element.current as HTMLDivElement;
    const measure = () => setSize([measured.clientWidth, measured.clientHeight]);
    const observer = new ResizeObserver(measure);
    measure();
    observer.observe(measured);
    return () => observer.disconnect();
  }, []);
  return { element, size };
}

export function Viewport() {
  const { element, size } = useElementSize();
  const visibleViews = shownViews.value;
  const columns = columnsFor(
    visibleViews.length,
    ...size,
    activeView.value === null ? 1 : activeView.value.width / activeView.value.height,
  );
  return (
    <main class="picture">
      <div class="canvas" ref={element}>
        <div class="cells" style={{ "--columns": columns }}>
          {visibleViews.map((name, index) => (
            // canvases are reused for other views: creating a graphics context is slow
            <ViewCell key={index} view={name} />
          ))}
        </div>
        <MatchBar />
        <PlacementBar />
        <FilterBadge />
        <AreaReadout />
        <HistogramView />
        <Toasts />
      </div>
      <CameraBar />
      <DifferenceLegend />
      <FalseColorLegend />
      <ViewportBar />
    </main>
  );
}
